"""Whose a connection on the loopback interface is, as the kernel of Linux tells it (proc(5))."""

from __future__ import annotations

import os
import socket
import struct
from pathlib import Path

_TABLES = {4: Path("/proc/net/tcp"), 6: Path("/proc/net/tcp6")}
_LOCAL, _REMOTE, _UID, _INODE = 1, 2, 7, 9  # columns
_ROOT = 0


def is_own_user(peer: tuple[str, int], here: tuple[str, int]) -> bool:
    """Tell whether a connection comes from a process of this user, or of root.

    Root, who could do all that this user can, also forwards ports for virtual machines. On systems
    that do not tell, everybody counts as this user.

    Parameters
    ----------
    peer, here : (str, int)
        Address and port of the other end of the connection, and of ours.
    """
    table = _TABLES[6 if ":" in peer[0] else 4]
    if not table.exists():
        return True
    ends = _coded(*peer), _coded(*here)
    for line in table.read_text().splitlines()[1:]:
        row = line.split()
        if (row[_LOCAL], row[_REMOTE]) == ends:
            # A socket that its process has closed is nobody's: no inode, and root's id.
            return int(row[_INODE]) != 0 and int(row[_UID]) in (os.getuid(), _ROOT)
    return False


def _coded(host: str, port: int) -> str:
    """Write an address as the table does: words of four bytes in the machine's order, the port."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    raw = socket.inet_pton(family, host)
    words = struct.unpack(f"={len(raw) // 4}I", raw)
    return "".join(f"{word:08X}" for word in words) + f":{port:04X}"
