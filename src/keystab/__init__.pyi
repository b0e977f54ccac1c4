"""What each public name is, for type checkers and editors; `__init__.py` loads them when used."""

from keystab._version import __version__ as __version__
from keystab.camera.edge_blur import edge_blur as edge_blur
from keystab.camera.made_scenes import make_scene as make_scene
from keystab.camera.psf_fit import fit_psf as fit_psf
from keystab.camera.simulation import simulate_view as simulate_view
from keystab.detection.detector import detect_keypoints as detect_keypoints
from keystab.errors import InputError as InputError
from keystab.io.keypoint_conventions import Convention as Convention
from keystab.io.keypoint_conventions import from_lafs as from_lafs
from keystab.io.keypoint_conventions import from_opencv as from_opencv
from keystab.io.keypoint_conventions import to_lafs as to_lafs
from keystab.io.keypoint_conventions import to_opencv as to_opencv
from keystab.io.keypoint_files import read_keypoints as read_keypoints
from keystab.io.keypoint_files import write_keypoints as write_keypoints
from keystab.io.pictures import read_picture as read_picture
from keystab.io.scale_space_store import open_scale_space as open_scale_space
from keystab.io.view_store import open_views as open_views
from keystab.matching.unique_keypoints import minimum_unique_set as minimum_unique_set
from keystab.matching.unique_keypoints import occurrence as occurrence
from keystab.matching.unique_keypoints import unique_keypoints as unique_keypoints
from keystab.prediction.uncertainty import keypoint_uncertainty as keypoint_uncertainty
from keystab.scalespace.dog import scale_space as scale_space
from keystab.scalespace.sampling import balanced_delta as balanced_delta
from keystab.truth.scene_extrema import scene_extrema as scene_extrema
from keystab.truth.true_extrema import true_extrema as true_extrema
