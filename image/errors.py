"""What a person can mend: said in words, without a traceback."""


class ImageError(Exception):
    """what is wrong, where and with which value; hint: what to do about it."""

    def __init__(self, what: str, hint: str = "") -> None:
        super().__init__(f"{what}\n  ({hint})" if hint else what)
