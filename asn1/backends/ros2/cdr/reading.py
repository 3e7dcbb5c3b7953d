"""Lines of a C function that reads CDR, and its error exits."""

from collections.abc import Iterator
from contextlib import contextmanager

from asn1.backends.ros2.cdr.lines import Functions, Lines, shape_name
from asn1.backends.ros2.cdr.shapes import SIZES
from asn1.backends.ros2.model import RosField


class Reading(Lines):
    """Code of one reading function.

    indexes   variables that count elements of lists
    exits     lines at its end: exits from lists
    ways_out  labels of the exits of the enclosing lists, outermost first
    """

    def __init__(self, functions: Functions) -> None:
        super().__init__(functions)
        self.indexes: list[str] = []
        self.exits: list[str] = []
        self.ways_out: list[str] = []

    def fail(self, call: str) -> None:
        """Write code that leaves the function with an error.

        Inside a list, its exit first adds the element's index to the path.
        """
        if self.ways_out:
            with self.block():
                self.put(f"{call};", f"goto {self.ways_out[-1]};")
        else:
            self.put(f"    return {call};")

    def fail_if(self, condition: str, call: str) -> None:
        self.put(f"if ({condition})")
        self.fail(call)

    def call(self, expression: str, name: str = "") -> None:
        """Write a call that reports its own error. name: field to put before the path of this error."""
        self.put(f"at = {expression};", "if (CAPTAIN_UNLIKELY(at == CAPTAIN_FAILED))")
        if name:
            self.fail(f'captain_cdr_in(r, "{name}")')
        elif self.ways_out:
            self.put(f"    goto {self.ways_out[-1]};")
        else:
            self.put("    return at;")

    @contextmanager
    def item(self, index: str, name: str) -> Iterator[None]:
        """Write the code of the context as that for an element of a list."""
        label = f"in_{index}"
        outer = f"goto {self.ways_out[-1]};" if self.ways_out else "return CAPTAIN_FAILED;"
        self.ways_out.append(label)
        before = len(self.lines)
        yield
        self.ways_out.pop()
        if any(f"goto {label};" in line for line in self.lines[before:]) or any(
            f"goto {label};" in one for one in self.exits
        ):
            self.exits += [f"{label}:", f'    captain_cdr_in_item(r, {index}, "{name}");', f"    {outer}"]

    def bool_at(self, at: str, into: str, name: str) -> None:
        self.fail_if(f"r->octets[{at}] > 1", f'captain_cdr_bad_bool(r, {at}, "{name}")')
        self.put(f"{into} = r->octets[{at}] != 0;")

    def skip(self, one: RosField, name: str, at: str = "at") -> None:
        """Write code that skips a field. name: its path in errors."""
        if not one.is_array and one.type in SIZES:
            size = SIZES[one.type]
            self.put(f"{at} = {behind(at, size)};")
            self.fail_if(f"CAPTAIN_UNLIKELY({at} > r->size)", f'captain_cdr_cut(r, {at} - {size}, "{name}")')
            return
        if not one.is_array and one.type != "string":
            expression = f'captain_cdr_skip(r, {at}, &{shape_name(one.type)}, "{name}")'
        else:
            expression = f"captain_cdr_walk_part(r, {at}, &{self.part(one, name)})"
        self.put(f"{at} = {expression};", f"if (CAPTAIN_UNLIKELY({at} == CAPTAIN_FAILED))")
        self.put(f"    goto {self.ways_out[-1]};" if self.ways_out else "    return CAPTAIN_FAILED;")


def behind(at: str, size: int) -> str:
    """Return the C expression of the offset after a number of `size` octets."""
    return f"{at} + 1" if size == 1 else f"captain_cdr_align({at}, {size}) + {size}"
