import numpy as np

from stiction_ros.online.input.samples import SetPointPreview

ONE = np.array([1.0])
STEP = 10


def test_a_preview_holds_each_set_point_until_the_next() -> None:
    preview = SetPointPreview((120, 140), np.array([[2.0], [3.0]]))
    assert preview.ahead(ONE, 100, STEP, 6).ravel().tolist() == [1, 2, 2, 3, 3, 3]


def test_what_a_preview_says_of_the_past_is_over() -> None:
    preview = SetPointPreview((120, 140), np.array([[2.0], [3.0]]))
    assert preview.ahead(ONE, 120, STEP, 4).ravel().tolist() == [1, 3, 3, 3]
    assert preview.ahead(ONE, 500, STEP, 2).ravel().tolist() == [1, 1]
