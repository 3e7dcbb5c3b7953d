"""Remedies for files that cannot be opened, read or written, by errno."""

import errno

_ELSEWHERE = "name a file elsewhere"
_BOTH = {
    errno.ENOTDIR: "a part of the path is a file; check the path",
    errno.EISDIR: "it is a folder; name a file",
    errno.ENAMETOOLONG: "choose a shorter name",
}
_READ = _BOTH | {
    errno.ENOENT: "check the path",
    errno.EACCES: "you may not read it; change its permissions",
    errno.EPERM: "you may not read it; change its permissions",
}
_WRITE = _BOTH | {
    errno.ENOENT: "create the folder first",
    errno.EACCES: f"you may not write there; {_ELSEWHERE}",
    errno.EPERM: f"you may not write there; {_ELSEWHERE}",
    errno.EROFS: f"the file system is read-only; {_ELSEWHERE}",
    errno.ENOSPC: f"the disk is full; remove files, or {_ELSEWHERE}",
    errno.EDQUOT: f"your quota is used up; remove files, or {_ELSEWHERE}",
}


def to_read(error: OSError) -> str:
    """Return the remedy for an error when a file is read; empty if the errno has none."""
    return _READ.get(error.errno or 0, "")


def to_write(error: OSError) -> str:
    """Return the remedy for an error when a file is written; empty if the errno has none."""
    return _WRITE.get(error.errno or 0, "")
