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


def recorder_trouble(told: Mapping[str, object]) -> str:
    """Why the recorder writes nothing, or keeps nothing; empty where it does, and where there is none."""
    if not told:
        return ""
    if told.get("is_running") is not True:
        return f"recorder: it does not run: {text(told, 'why')}"
    words = []
    if trouble := text(told, "trouble"):
        words.append(f"{text(told, 'folder')}: {trouble}; {number(told, 'lost'):.0f} frames lost")
    if not_kept := number(told, "not_kept"):
        words.append(f"{not_kept:.0f} events not kept whole: remove what was kept before from {text(told, 'folder')}")
    return f"recorder: {'; '.join(words)}" if words else ""
