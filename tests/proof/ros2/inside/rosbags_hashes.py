"""Hashes of a directory of .msg files, as rosbags computes them: a JSON object on stdout."""

import json
import sys
from pathlib import Path

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

folder = Path(sys.argv[1])
store = get_typestore(Stores.ROS2_JAZZY)
types = {}
for path in sorted((folder / "msg").glob("*.msg")):
    types |= get_types_from_msg(path.read_text(encoding="utf-8"), f"{folder.name}/msg/{path.stem}")
store.register(types)
print(json.dumps({name.rpartition("/")[2]: store.hash_rihs01(name) for name in types}))
