#!/usr/bin/env bash
# Make the virtual environment with ROS 2 Jazzy and the requirements of a target, pinned.
# Usage: bootstrap.sh PYTHON VENV REQUIREMENTS... [--wheelhouse FOLDER]
# What only the system can provide (a C++ compiler, cmake, Python's headers, venv) is installed by apt where that is
# allowed; without root rights the command to run is printed.
set -euo pipefail
python=$1
venv=$2
shift 2
cd "$(dirname "$0")/.."
requirements=()
source=()
while [ $# -gt 0 ]; do
    if [ "$1" = --wheelhouse ]; then
        source=(--no-index --find-links "$2")
        shift 2
    else
        requirements+=(-r "$1")
        shift
    fi
done

missing=()
"$python" -c 'import ensurepip, venv' 2>/dev/null || missing+=(python3-venv)
"$python" -c 'import os, sysconfig, sys; sys.exit(not os.path.exists(sysconfig.get_path("include") + "/Python.h"))' ||
    missing+=(python3-dev)
command -v g++ >/dev/null || missing+=(g++)
command -v cc >/dev/null || missing+=(gcc)
command -v cmake >/dev/null || missing+=(cmake)
command -v git >/dev/null || missing+=(git)
if [ ${#missing[@]} -gt 0 ]; then
    echo "bootstrap: this machine lacks: ${missing[*]}"
    if [ "$(id -u)" = 0 ]; then as_root=(); elif sudo -n true 2>/dev/null; then as_root=(sudo); else
        echo "bootstrap: please run: sudo apt-get install ${missing[*]}" >&2
        exit 2
    fi
    "${as_root[@]}" apt-get update -qq
    "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}"
fi

version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
case $version in
    3.11 | 3.12) ;;
    *)
        echo "bootstrap: Python is $version; the ROS 2 wheels are tested with 3.11 and 3.12 (make PYTHON=python3.12 ...)" >&2
        exit 2
        ;;
esac

echo "bootstrap: installing ROS 2 Jazzy and libraries into $venv"
[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
# Modules are compiled when they are first imported, which most never are.
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile "${source[@]}" "${requirements[@]}"
"$venv/bin/python" tools/share_duplicates.py "$venv"
echo "bootstrap: $venv takes $(du -sm "$venv" | cut -f1) MB"
