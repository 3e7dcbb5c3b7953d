"""Hashes of a directory of .msg files, as ROS's own generators compute them: a JSON object on stdout."""

import contextlib
import json
import sys
import tempfile
from pathlib import Path

from ament_index_python.packages import get_package_share_path
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_generator_type_description import generate_type_hash

folder = Path(sys.argv[1])
with tempfile.TemporaryDirectory() as made, contextlib.redirect_stdout(sys.stderr):
    root = Path(made)
    paths = sorted((folder / "msg").glob("*.msg"))
    for path in paths:
        convert_msg_to_idl(folder, folder.name, path.relative_to(folder), root / "msg")
    arguments = {
        "package_name": folder.name,
        "output_dir": str(root / "out"),
        "idl_tuples": [f"{root}:msg/{path.stem}.idl" for path in paths],
        "include_paths": [f"{name}:{get_package_share_path(name)}" for name in ("std_msgs", "builtin_interfaces")],
    }
    (root / "arguments.json").write_text(json.dumps(arguments), encoding="utf-8")
    generate_type_hash(str(root / "arguments.json"))
    hashes = {}
    for path in sorted((root / "out").rglob("*.json")):
        for one in json.loads(path.read_text(encoding="utf-8"))["type_hashes"]:
            if one["type_name"].startswith(f"{folder.name}/"):
                hashes[one["type_name"].rpartition("/")[2]] = one["hash_string"]
print(json.dumps(hashes))
