"""What a status says of the folder that is to outlive a restart, in words."""

from collections.abc import Mapping

from firmware.user.untrusted import number, text


def trouble(told: Mapping[str, object]) -> str:
    """Why something is not kept, and what to do; empty where all is well, and where nothing is expected."""
    state, refused = text(told, "state"), number(told, "refused")
    if not told or (state == "kept" and not refused):
        return ""
    words = [f"storage: {text(told, 'folder')} is {state}", text(told, "hint")]
    if refused:
        words.append(f"{refused:.0f} writes refused, the last: {text(told, 'last_refusal')}")
    return "; ".join(word for word in words if word)
