"""Users and groups that are added to a root: fixed numbers, so that what is kept on the data partition stays theirs."""

from typing import NamedTuple

from image.tree import Tree

# Of no day: shadow(5) wants one, and 0 would ask for a change.
CHANGED = 19000
SHELL = "/bin/bash"
NOBODY = "/usr/sbin/nologin"


class Group(NamedTuple):
    name: str
    number: int
    members: tuple[str, ...] = ()


class User(NamedTuple):
    """A user with a group of the same name and number; no password: a key, or the cable."""

    name: str
    number: int
    home: str
    shell: str


# Debian gives 100 to 999 to system users from both ends; these are in the middle.
USERS = (User("captain", 560, "/var/lib/captain", NOBODY), User("operator", 561, "/home/operator", SHELL))
GROUPS = (Group("gpio", 562), Group("pps", 563), Group("i2c", 564))
# captain: the station's control socket, its recordings and the owner's captain.toml in force. systemd-journal: the
# journal, in which the station says why it has ended. The others are the hardware's, as the station has them.
MEMBERS = {"operator": ("captain", "systemd-journal", "dialout", "gpio", "pps", "i2c"), "captain": ("dialout",)}


def add(tree: Tree) -> None:
    """Debian's own users keep theirs; raises ImageError where a root has no such files."""
    passwd, shadow, group, gshadow = (_rows(tree, f"etc/{name}") for name in ("passwd", "shadow", "group", "gshadow"))
    for each in (*(Group(user.name, user.number) for user in USERS), *GROUPS):
        if each.name not in group:
            group[each.name] = [each.name, "x", str(each.number), ""]
            gshadow[each.name] = [each.name, "*", "", ""]
    for user in USERS:
        # Debian has a group operator of its own, 37: what is the group's has to be the user's.
        passwd[user.name] = [user.name, "x", str(user.number), group[user.name][2], "", user.home, user.shell]
        shadow[user.name] = [user.name, "*", str(CHANGED), "0", "99999", "7", "", "", ""]
    for user_name, names in MEMBERS.items():
        for name in names:
            for rows in (group, gshadow):
                members = [*filter(None, rows[name][3].split(",")), user_name]
                rows[name][3] = ",".join(dict.fromkeys(members))
    # Nobody comes in by a word: root has none either.
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
