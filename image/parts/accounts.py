"""Users and groups with fixed numbers, so that data keeps its owners."""

from typing import NamedTuple

from image.filesystem.tree import Tree

# Fixed date of the last password change, as shadow(5) needs one; 0 would demand a change at login.
CHANGED = 19000
SHELL = "/bin/bash"
NOBODY = "/usr/sbin/nologin"


class SystemGroup(NamedTuple):
    name: str
    number: int
    members: tuple[str, ...] = ()


class User(NamedTuple):
    """User with a group of the same name and number. No user has a password: login is by key or serial cable."""

    name: str
    number: int
    home: str
    shell: str


# Debian assigns 100 to 999 to system users from both ends; these numbers are in the middle.
USERS = (User("captain", 560, "/var/lib/captain", NOBODY), User("operator", 561, "/home/operator", SHELL))
GROUPS = (SystemGroup("gpio", 562), SystemGroup("pps", 563), SystemGroup("i2c", 564))
# operator needs captain for the control socket, the recordings and the owner's captain.toml. It needs systemd-journal
# for the station's errors. The other groups give access to the hardware, as the station has.
MEMBERS = {"operator": ("captain", "systemd-journal", "dialout", "gpio", "pps", "i2c"), "captain": ("dialout",)}


def add(tree: Tree) -> None:
    """Add users and groups; Debian's own users remain. Raises ImageError if the tree has no such files."""
    passwd, shadow, group, gshadow = (_rows(tree, f"etc/{name}") for name in ("passwd", "shadow", "group", "gshadow"))
    for each in (*(SystemGroup(user.name, user.number) for user in USERS), *GROUPS):
        if each.name not in group:
            group[each.name] = [each.name, "x", str(each.number), ""]
            gshadow[each.name] = [each.name, "*", "", ""]
    for user in USERS:
        # Debian has a group `operator`, 37, so the user gets that group's number.
        passwd[user.name] = [user.name, "x", str(user.number), group[user.name][2], "", user.home, user.shell]
        shadow[user.name] = [user.name, "*", str(CHANGED), "0", "99999", "7", "", "", ""]
    for user_name, names in MEMBERS.items():
        for name in names:
            for rows in (group, gshadow):
                members = [*filter(None, rows[name][3].split(",")), user_name]
                rows[name][3] = ",".join(dict.fromkeys(members))
    # All passwords are disabled, root's too.
    for row in shadow.values():
        row[1], row[2] = "*", str(CHANGED)
    for name, rows, mode in (
        ("passwd", passwd, 0o644),
        ("shadow", shadow, 0o640),
        ("group", group, 0o644),
        ("gshadow", gshadow, 0o640),
    ):
        tree.write(f"etc/{name}", "".join(":".join(row) + "\n" for row in rows.values()), mode)
    tree.folder("home/operator", 0o750, (USERS[1].number, int(group["operator"][2])))


def _rows(tree: Tree, path: str) -> dict[str, list[str]]:
    lines = tree.read(path).decode().splitlines()
    return {line.split(":")[0]: line.split(":") for line in lines if line}
