"""The committed picture of the data flow is the one that the program draws."""

from tests.reference.data_flow import PICTURE, picture


def test_picture_of_the_data_flow_is_the_generated_one() -> None:
    assert PICTURE.read_text() == picture(), "run `make reference`"
