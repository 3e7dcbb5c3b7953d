"""Parameters of a node: declares and reads them, and reports changes."""

from collections.abc import Callable, Mapping
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult

from .errors import GatewayError
from .handlers import KINDS
from .settings import GATEWAY, HANDLER, Option

Values = Mapping[str, Any]


class Parameters:
    """Parameters of a node. Their values stay as ROS has them; each was validated."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._options: dict[str, Option] = {}

    def gateway(self) -> dict[str, Any]:
        """Declare the parameters of the gateway. Returns their parsed values.

        Raises GatewayError for an invalid value.
        """
        return {name: option.read(self._declare(name, option)) for name, option in GATEWAY.items()}

    def handler(self, name: str) -> dict[str, Any]:
        """Declare the parameters of a handler.

        Returns their values as ROS has them. Raises GatewayError for an invalid value.
        """
        return {key: self._declare(f"{name}.{key}", option) for key, option in HANDLER.items()}

    def unknown(self) -> list[str]:
        """Return the names of given parameters that do not exist. ROS does not report a misspelt name."""
        given = getattr(self._node, "_parameter_overrides", {})  # rclpy has no public attribute for it
        of_handlers = {f"{kind}.{rest}" for kind in KINDS for rest in HANDLER}
        return sorted(
            name for name in given
            if not (self._node.has_parameter(name) or name in of_handlers or name.startswith("qos_overrides."))
        )  # fmt: skip

    def on_change(self, changed: Callable[[str, Any], None]) -> None:
        """Call `changed` for each later change, with the full name and the value as ROS has it."""

        def check(parameters: list[Any]) -> SetParametersResult:
            for one in parameters:
                option = self._options.get(one.name)
                if option is None:
                    continue
                try:
                    option.read(_plain(one.value))
                except ValueError as error:
                    return SetParametersResult(successful=False, reason=f"{one.name}: {error}")
            return SetParametersResult(successful=True)

        def tell(parameters: list[Any]) -> None:
            for one in parameters:
                if one.name in self._options:
                    changed(one.name, _plain(one.value))

        def check_and_tell(parameters: list[Any]) -> SetParametersResult:
            result = check(parameters)
            if result.successful:
                tell(parameters)
            return result

        # Humble has no callback after a change. There the check itself reports it; no other callback can refuse it
        # later.
        if hasattr(self._node, "add_post_set_parameters_callback"):
            self._node.add_on_set_parameters_callback(check)
            self._node.add_post_set_parameters_callback(tell)
        else:
            self._node.add_on_set_parameters_callback(check_and_tell)

    def _declare(self, name: str, option: Option) -> Any:
        # Dynamic typing, because an empty list has no element type, and a whole number is allowed for a float.
        descriptor = ParameterDescriptor(description=option.meaning, read_only=option.is_fixed, dynamic_typing=True)
        try:
            value = _plain(self._node.declare_parameter(name, option.default, descriptor).value)
            option.read(value)
        except ValueError as error:
            raise GatewayError(f"parameter {name}: {error}") from error
        self._options[name] = option
        return value


def _plain(value: Any) -> Any:
    """Return a value with lists in place of array.array, which rclpy uses for numbers."""
    return list(value) if hasattr(value, "typecode") else value
