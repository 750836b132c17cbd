# SPDX-License-Identifier: GPL-3.0-or-later
"""Missing system libraries are named, with the packages that bring them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from scripts import check_system

#: What ldd prints on a bare server (shortened).
BARE_SERVER = """\
\tlinux-vdso.so.1 (0x00007f11c054d000)
\tlibtbb.so.12 => /site-packages/bpy/lib/libtbb.so.12 (0x00007f11c04e6000)
\tlibXrender.so.1 => not found
\tlibXi.so.6 => not found
\tlibxkbcommon.so.0 => not found
\tlibSM.so.6 => not found
\tlibSM.so.6 => not found
\tlibunheardof.so.9 => not found
\tlibc.so.6 => /lib/x86_64-linux-gnu/libc.so.6 (0x00007f119a01e000)
"""
OLD_SYSTEM = "./__init__.so: /lib/libc.so.6: version `GLIBC_2.28' not found (required by ./a.so)\n"


def test_missing_libraries_come_with_their_packages():
    missing, too_old = check_system.parse_ldd(BARE_SERVER)
    assert missing == [
        "libSM.so.6",
        "libXi.so.6",
        "libXrender.so.1",
        "libunheardof.so.9",
        "libxkbcommon.so.0",
    ]
    assert too_old == []
    text = check_system.report(missing)
    assert "apt-get install -y libsm6 libxi6 libxkbcommon0 libxrender1" in text
    assert "apt-file search libunheardof.so.9" in text


def test_an_old_c_library_is_named():
    missing, too_old = check_system.parse_ldd(OLD_SYSTEM)
    assert (missing, too_old) == ([], ["GLIBC_2.28"])
    assert "GLIBC_2.28" in check_system.report(missing, too_old)


def test_nothing_missing_says_nothing():
    assert check_system.report([]) == ""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks Linux's dynamic loader")
def test_a_library_that_needs_a_missing_one_is_reported(tmp_path: Path):
    """A stand-in for ldd, so that the whole way from the loader to the message is walked."""
    ldd = tmp_path / "ldd"
    ldd.write_text(f"#!/bin/sh\ncat <<'END'\n{BARE_SERVER}END\n")
    ldd.chmod(0o755)
    assert "libxrender1" in check_system.check(tmp_path / "any.so", ldd=str(ldd))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks Linux's dynamic loader")
def test_this_machine_is_complete(root: Path):
    done = subprocess.run(
        [sys.executable, str(root / "scripts/check_system.py")], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "bpy" in done.stdout
