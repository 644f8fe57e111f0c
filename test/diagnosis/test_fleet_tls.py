"""The TLS options of `hand diagnose --scheduler`: a real scheduler that admits certificates of its authority only."""

from __future__ import annotations

import datetime
import ipaddress
import json
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from typer.testing import CliRunner

from hand_diagnosis.fleet import Cluster
from hand_tool.cli import app
from test.diagnosis.clusters import cluster
from test.diagnosis.recordings import CONFIG

TLS_FILES = ("--tls-ca", "--tls-cert", "--tls-key")


def certificate(folder: Path, name: str) -> tuple[Path, Path]:
    """A self-signed certificate for this machine, and its key: an authority with a single member."""
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    now = datetime.datetime.now(datetime.UTC)
    built = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]), critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(key, hashes.SHA256())
    )
    paths = folder / f"{name}.pem", folder / f"{name}.key"
    paths[0].write_bytes(built.public_bytes(serialization.Encoding.PEM))
    paths[1].write_bytes(
        key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    )
    return paths


def diagnose(recording: Path, out: Path, *options: str) -> tuple[int, str]:
    command = ["diagnose", str(recording), "--model", str(CONFIG), "--out", str(out), "--json", *options]
    result = CliRunner().invoke(app, command)
    return result.exit_code, result.output.splitlines()[-1]


def options(*paths: Path) -> list[str]:
    return [part for pair in zip(TLS_FILES, map(str, paths), strict=True) for part in pair]


def test_a_recording_is_diagnosed_over_tls(tmp_path: Path) -> None:
    """Fails when the certificates do not reach dask, or the connection is not encrypted on demand of the scheduler."""
    pem, key = certificate(tmp_path, "node")
    files = ["--tls-ca-file", str(pem), "--tls-cert", str(pem), "--tls-key", str(key)]
    bad = tmp_path / "bad.mcap"
    bad.write_text("nothing\n", encoding="utf-8")
    with cluster(tmp_path, *files, scheme="tls") as address:
        code, line = diagnose(bad, tmp_path / "out", "--scheduler", address, *options(pem, pem, key))
    assert code == 0, line
    assert json.loads(line)["verdicts"] == {"unusable": 1}


def test_options_that_do_not_fit_are_one_line(tmp_path: Path) -> None:
    """Fails when a scheduler is used without the certificates that it needs, or certificates are ignored."""
    pem, key = certificate(tmp_path, "node")
    bad = tmp_path / "bad.mcap"
    bad.write_text("nothing\n", encoding="utf-8")
    for given, reason in (
        (["--scheduler", "tls://127.0.0.1:1"], "needs --tls-ca, --tls-cert, --tls-key"),
        (["--scheduler", "tls://127.0.0.1:1", "--tls-ca", str(pem)], "needs --tls-ca, --tls-cert, --tls-key"),
        (
            ["--scheduler", "tcp://127.0.0.1:1", "--tls-ca", str(pem)],
            "needs a --scheduler address that begins with tls",
        ),
        (["--tls-key", str(key)], "need --scheduler tls://HOST:PORT"),
        (["--scheduler", "tls://127.0.0.1:1", *options(pem, pem, tmp_path / "no.key")], "no.key is not a file"),
        (["--scheduler", "tls://127.0.0.1:1", *options(bad, pem, key)], "--tls-key cannot be used"),
    ):
        code, line = diagnose(bad, tmp_path / "out", *given)
        assert code == 2 and reason in line, line


def test_a_client_demands_encryption(tmp_path: Path) -> None:
    """Fails when TLS was asked for and dask may fall back to plain connections."""
    pem, key = certificate(tmp_path, "node")
    assert Cluster("tls://127.0.0.1:1", pem, pem, key).security().require_encryption
    assert Cluster("tcp://127.0.0.1:1").security() is None
