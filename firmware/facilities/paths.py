"""Paths of components in JSON, such as "cam.camParameters.x[0].y", as the message library writes them."""

from collections.abc import Iterator

from drivers.wire.type_tree import Type


def joined(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


def type_at(kind: Type, path: str) -> Type | None:
    """Return the type at a path of an error, such as "cam.camParameters.x[0].y"; None if the path leaves the tree."""
    for name in steps_of(path):
        if name.isdecimal():
            found = kind.element
        else:
            found = next((field.type for field in kind.fields if field.name == name), None)
        if found is None:
            return None
        kind = found
    return kind


def replace_at(value: object, path: str, new: object) -> bool:
    """Replace the value at a path. Return False if the path leads nowhere."""
    *steps, last = steps_of(path)
    for name in steps:
        value = _inside(value, name)
    if isinstance(value, dict) and last in value:
        value[last] = new
        return True
    if isinstance(value, list) and last.isdecimal() and int(last) < len(value):
        value[int(last)] = new
        return True
    return False


def value_at(value: object, path: str) -> object:
    for name in steps_of(path):
        value = _inside(value, name)
    return value


def remove_at(value: object, path: str) -> bool:
    """Remove the component at a path. Return False if the path leads nowhere."""
    *steps, last = steps_of(path)
    for name in steps:
        value = _inside(value, name)
    if isinstance(value, dict) and last in value:
        del value[last]
        return True
    return False


def steps_of(path: str) -> Iterator[str]:
    """Return the components of a path; an index is one as well."""
    return iter(path.replace("[", ".").replace("]", "").split("."))


def _inside(value: object, name: str) -> object:
    if isinstance(value, dict):
        return value.get(name)
    if isinstance(value, list) and name.isdecimal() and int(name) < len(value):
        return value[int(name)]
    return None
