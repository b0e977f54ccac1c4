"""Pictures of every container, compression, depth, byte order and colour: exact or refused."""

import pytest
import zoo_others
import zoo_tiff
import zoo_tiff_by_hand
from zoo_base import verdict

GROUPS = {
    "tifffile": zoo_tiff.by_tifffile,
    "opencv": zoo_tiff.by_opencv,
    "pillow": zoo_tiff.by_pillow,
    "by hand": zoo_tiff_by_hand.by_hand,
    "pages beside": zoo_tiff_by_hand.with_pages_beside,
    "netpbm": zoo_others.netpbm,
    "others": zoo_others.others,
    "turned": zoo_others.turned,
}


@pytest.mark.parametrize("group", GROUPS)
def test_every_picture_is_exact_or_refused_in_one_line(group, tmp_path):
    wrong = {case.name: verdict(case, tmp_path) for case in GROUPS[group]()}
    assert {name: what for name, what in wrong.items() if what} == {}


def test_the_pictures_are_many_and_have_names_of_their_own():
    names = [case.name for make in GROUPS.values() for case in make()]
    assert len(names) > 700 and len(set(names)) == len(names)
