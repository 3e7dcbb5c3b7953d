"""Storage section of a status as text: problems of its folder and of the recorder."""

from collections.abc import Mapping

from firmware.untrusted import number, text


def trouble(told: Mapping[str, object]) -> str:
    """Return why the storage folder does not keep files, and the remedy.

    Empty without a problem or without a folder.
    """
    state, hint, refused = text(told, "state"), text(told, "hint"), number(told, "refused")
    if not told or (state == "kept" and not refused):
        return ""
    is_over = state == "kept" and not hint
    words = [f"storage: {text(told, 'folder')} is {state}{' again' if is_over else ''}", hint]
    if refused:
        count = f"{refused:.0f} writes {'were ' if is_over else ''}refused"
        words.append(f"{count}, the last: {text(told, 'last_refusal')}")
    return "; ".join(word for word in words if word)


def recorder_trouble(told: Mapping[str, object]) -> str:
    """Return why the recorder does not run, write or keep files; empty without a problem or without a recorder."""
    if not told:
        return ""
    if told.get("is_running") is not True:
        return f"recorder: it does not run: {text(told, 'why')}"
    words = []
    if trouble := text(told, "trouble"):
        words.append(f"{text(told, 'folder')}: {trouble}; {number(told, 'lost'):.0f} frames lost")
    if not_kept := number(told, "not_kept"):
        words.append(f"{not_kept:.0f} events not kept whole: raise recorder.size_mb")
    return f"recorder: {'; '.join(words)}" if words else ""
