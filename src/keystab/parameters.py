"""The study's parameters in the blocks in which they are handed on, each block once.

A block is what belongs together: rules give it to stages setting by setting, stages read it from
their command line, functions take it as one argument. A field says its type, where it stands in the
settings (config/README.md explains all of them) and what it means. In a place, ``{set}`` stands for
the name of a set of views, ``{variant}`` for that of a variant of the arithmetic.

A stage depends on the code of the blocks that it uses and of no other; see
`keystab.provenance.code_digest.CATALOGUES`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple


class Setting(NamedTuple):
    """Where a parameter stands in the settings, and what it means."""

    place: str
    meaning: str


# ---------------------------------------------------------------------------------------------
# Pictures and views


@dataclass(frozen=True)
class Reference:
    """The picture that the simulated camera looks at (section 4)."""

    reference_sha256: Annotated[
        str | None, Setting("reference_sha256", "SHA-256 of its pixels; None is not checked")
    ]
    reference_blur: Annotated[
        float, Setting("reference_blur", "blur that it has of itself, its pixels")
    ]


@dataclass(frozen=True)
class Camera:
    """The views of a set (section 4); one number for all of them, or one for each."""

    blur: Annotated[list[float], Setting("sets.{set}.blur", "camera blur, pixels of the view")]
    step: Annotated[list[float], Setting("sets.{set}.step", "subsampling step")]
    shift_y: Annotated[list[float], Setting("sets.{set}.shift_y", "shift down, pixels of the view")]
    shift_x: Annotated[list[float], Setting("sets.{set}.shift_x", "shift right, pixels")]
    rotation: Annotated[list[float], Setting("sets.{set}.rotation", "rotation, radians")]
    noise: Annotated[list[float], Setting("sets.{set}.noise", "standard deviation of the noise")]
    tilt: Annotated[list[float], Setting("sets.{set}.tilt", "tilt of the scene's plane, degrees")]
    azimuth: Annotated[
        list[float], Setting("sets.{set}.azimuth", "direction in which it recedes, degrees")
    ]
    focal_length: Annotated[
        float, Setting("sets.{set}.focal_length", "focal length of tilted views, pixels")
    ]
    height: Annotated[
        int | None, Setting("sets.{set}.height", "height, pixels; None for the whole reference")
    ]
    width: Annotated[
        int | None, Setting("sets.{set}.width", "width, pixels; None for the whole reference")
    ]
    whole: Annotated[
        bool, Setting("sets.{set}.whole", "whether every view shows the whole reference")
    ]
    guard: Annotated[int, Setting("sets.{set}.guard", "width of the guard band, pixels")]


# ---------------------------------------------------------------------------------------------
# Detection


@dataclass(frozen=True)
class Scales:
    """First scale and ratio of the difference of Gaussians (section 2)."""

    sigma_min: Annotated[float, Setting("detector.sigma_min", "first scale, pixels of the view")]
    kappa: Annotated[float, Setting("detector.kappa", "ratio of the two blurs")]


@dataclass(frozen=True)
class DifferenceOfGaussians(Scales):
    """The difference-of-Gaussians scale-space (section 2)."""

    oversampling: Annotated[
        Literal["spline", "cosine"],
        Setting("detector.oversampling", "how the view is oversampled"),
    ]


@dataclass(frozen=True)
class Detection(DifferenceOfGaussians):
    """The difference-of-Gaussians scale-space and its discrete extrema (section 2)."""

    epsilon: Annotated[
        float, Setting("detector.epsilon", "least difference to the 26 neighbours, grey values")
    ]


@dataclass(frozen=True)
class ScaleSpaceOfViews(DifferenceOfGaussians):
    """The difference-of-Gaussians scale-spaces of the views of a set."""

    sigma_min: Annotated[float, Setting("sets.{set}.sigma_min", "first scale, pixels of the view")]
    n_oct: Annotated[int, Setting("sets.{set}.n_oct", "octaves")]
    delta_min: Annotated[
        float | None,
        Setting("sets.{set}.delta_min", "sampling step, pixels; None for the balanced one"),
    ]
    assumed_blur: Annotated[
        float | None,
        Setting("sets.{set}.assumed_blur", "camera blur to assume, pixels; None for each view's"),
    ]


@dataclass(frozen=True)
class DetectionInViews(ScaleSpaceOfViews):
    """The discrete extrema of the views of a set."""

    guard: Annotated[int, Setting("sets.{set}.guard", "width of the guard band, pixels")]
    epsilon: Annotated[
        float, Setting("detector.epsilon", "least difference to the 26 neighbours, grey values")
    ]


@dataclass(frozen=True)
class Arithmetic:
    """A variant of the arithmetic in which extrema are computed (figure floor)."""

    oversampling: Annotated[
        Literal["spline", "cosine"],
        Setting("floor.variants.{variant}.oversampling", "how the view is oversampled"),
    ]
    arithmetic: Annotated[
        Literal["float64", "float32", "float32_sums", "float32_transforms"],
        Setting("floor.variants.{variant}.arithmetic", "number type, and of what"),
    ]
    epsilon: Annotated[
        float, Setting("floor.variants.{variant}.epsilon", "least difference in single precision")
    ]
    grey_range: Annotated[
        float, Setting("floor.variants.{variant}.grey_range", "white in single precision")
    ]
    bits: Annotated[
        int | None, Setting("floor.variants.{variant}.bits", "bits of a pixel; None for floats")
    ]
    sides: Annotated[
        Literal["small", "large"],
        Setting(
            "floor.variants.{variant}.sides", "prime factors of the sides that are transformed"
        ),
    ]


@dataclass(frozen=True)
class Readings:
    """What the paper's words about new and lost extrema are taken to mean (figure floor)."""

    settles_at: Annotated[int, Setting("floor.settles_at", "n_spo from which rates are averaged")]
    epsilons: Annotated[list[float], Setting("floor.epsilons", "tolerances, of the grey range")]
    limits: Annotated[list[float], Setting("floor.limits", "largest distances, pixels")]


@dataclass(frozen=True)
class RefinementPath:
    """How the refinement goes from one quadratic model to the next (equation 2)."""

    scale_moves: Annotated[
        bool, Setting("refinement.scale_moves", "whether a step may change the scale")
    ]
    move: Annotated[Literal["nearest", "unit_step"], Setting("refinement.move", "how a step goes")]
    max_offset: Annotated[
        float, Setting("refinement.max_offset", "offset above which it goes on, samples")
    ]


@dataclass(frozen=True)
class Acceptance:
    """Which refined keypoints are accepted (section 5.5)."""

    max_offset: Annotated[float, Setting("refinement.max_offset", "M_offset, samples")]
    max_iterations: Annotated[int, Setting("refinement.max_iterations", "N_interp")]


@dataclass(frozen=True)
class Refining(Acceptance):
    """How extrema are refined, and which are accepted (equation 2, section 5.5)."""

    scale_moves: Annotated[
        bool, Setting("refinement.scale_moves", "whether a step may change the scale")
    ]
    move: Annotated[Literal["nearest", "unit_step"], Setting("refinement.move", "how a step goes")]


@dataclass(frozen=True)
class SiftFilters:
    """SIFT's own choices: which refined keypoints are accepted, and its filters (figure 7)."""

    max_offset: Annotated[float, Setting("refinement.max_offset", "M_offset, samples")]
    max_iterations: Annotated[int, Setting("shipped.max_iterations", "N_interp of SIFT")]
    contrast: Annotated[float, Setting("shipped.contrast", "least absolute DoG value")]
    edge_ratio: Annotated[
        float, Setting("shipped.edge_ratio", "largest ratio of the principal curvatures")
    ]


# ---------------------------------------------------------------------------------------------
# Comparison


@dataclass(frozen=True)
class Tolerance:
    """How far apart two detections of the same keypoint may be (equation 22)."""

    space_tolerance: Annotated[
        float, Setting("comparison.space_tolerance", "largest distance in y and in x, pixels")
    ]
    scale_ratio: Annotated[float, Setting("comparison.scale_ratio", "largest ratio of scales")]


@dataclass(frozen=True)
class Same(Tolerance):
    """When two detections are the same keypoint (equation 22)."""

    match_sign: Annotated[bool, Setting("comparison.match_sign", "whether signs must agree")]


@dataclass(frozen=True)
class Compared:
    """Which detections are compared (section 5.1)."""

    border: Annotated[
        float, Setting("comparison.border", "pixels left out at the border of the view")
    ]
    first_scale: Annotated[
        float, Setting("comparison.first_scale", "lower end of the scales, over sigma-min")
    ]
    last_scale: Annotated[
        float | None,
        Setting("comparison.last_scale", "upper end of the scales, over sigma-min; None for none"),
    ]


@dataclass(frozen=True)
class ComparedInViews(Compared):
    """Which detections in the views of a set are compared (sections 5.1 and 5.5)."""

    sigma_min: Annotated[float, Setting("sets.{set}.sigma_min", "first scale, pixels of the view")]
    n_oct: Annotated[int, Setting("sets.{set}.n_oct", "octaves")]
    guard: Annotated[int, Setting("sets.{set}.guard", "width of the guard band, pixels")]


@dataclass(frozen=True)
class ComparedWithTruth(Compared):
    """Which detections are held against true extrema (figures truth and refinement)."""

    last_scale: Annotated[
        float, Setting("truth.last_scale", "upper end of the scales, over sigma-min")
    ]


@dataclass(frozen=True)
class ShotPairs:
    """Pairs of shots against which error bars are held (figure uncertainty)."""

    noise: Annotated[list[float], Setting("uncertainty.noise", "standard deviations of the noise")]
    n_pairs: Annotated[int, Setting("uncertainty.n_pairs", "pairs of the first view")]
    n_pairs_others: Annotated[
        int, Setting("uncertainty.n_pairs_others", "pairs of other views and kinds of noise")
    ]
    n_moved: Annotated[int, Setting("uncertainty.n_moved", "shots of each moved view")]
    n_spo: Annotated[int, Setting("uncertainty.n_spo", "scales per octave")]
    n_oct: Annotated[int, Setting("uncertainty.n_oct", "octaves")]


@dataclass(frozen=True)
class Stable:
    """Which keypoints are stable and which are unstable (section 5.3)."""

    stable_above: Annotated[
        float, Setting("comparison.stable_above", "share of samplings of a stable keypoint")
    ]
    unstable_below: Annotated[
        float, Setting("comparison.unstable_below", "share of samplings of an unstable one")
    ]


@dataclass(frozen=True)
class Octaves:
    """Octaves whose keypoints are counted, within those searched (figures 11 and 12)."""

    starts: Annotated[list[float], Setting("stability.starts", "first scales, pixels")]
    seen_by: Annotated[
        float, Setting("stability.seen_by", "least share of the views that see a keypoint")
    ]


@dataclass(frozen=True)
class Folds:
    """How detections are split into those learnt from and those predicted (figure predictors)."""

    block: Annotated[
        float, Setting("predictors.block", "side of the squares that stay together, pixels")
    ]
    n_folds: Annotated[int, Setting("predictors.n_folds", "folds of the squares of a picture")]


@dataclass(frozen=True)
class Stated:
    """What is asked of the camera and of single views because the text says it."""

    camera_blurs: Annotated[
        list[float], Setting("stated.camera_blurs", "camera blurs whose aliasing is measured")
    ]
    assumed_blurs: Annotated[
        list[float], Setting("stated.assumed_blurs", "blurs that are assumed instead, pixels")
    ]
    zooms: Annotated[list[float], Setting("stated.zooms", "zooms whose true extrema are compared")]
    kappas: Annotated[list[float], Setting("stated.kappas", "ratios of the two blurs, for these")]
    noise_factors: Annotated[
        list[float], Setting("stated.noise_factors", "noise added to the reference, over its own")
    ]


# ---------------------------------------------------------------------------------------------
# Audits


@dataclass(frozen=True)
class AuditPlan:
    """How much is asked of the detectors of others."""

    width: Annotated[
        int, Setting("audit.width", "width of a view, pixels; less where the picture is small")
    ]
    n_views: Annotated[
        int, Setting("audit.n_views", "views of most conditions; translations have twice as many")
    ]
    blobs: Annotated[int, Setting("audit.blobs", "blobs of each size along each side")]


# ---------------------------------------------------------------------------------------------
# Theory


@dataclass(frozen=True)
class Semigroup:
    """A blob blurred many times by little, and once by much (figure 1)."""

    blob: Annotated[float, Setting("semigroup.blob", "standard deviation of the blob, pixels")]
    n_passes: Annotated[int, Setting("semigroup.n_passes", "number of small blurs")]
    sigma_from: Annotated[float, Setting("semigroup.sigma_from", "smallest small blur, pixels")]
    sigma_to: Annotated[float, Setting("semigroup.sigma_to", "largest small blur, pixels")]
    sigma_count: Annotated[int, Setting("semigroup.sigma_count", "number of small blurs tried")]
    truncation: Annotated[
        float, Setting("semigroup.truncation", "radius of the sampled kernel, over sigma")
    ]


@dataclass(frozen=True)
class Optics:
    """Model cameras (figure S3)."""

    f_numbers: Annotated[list[float], Setting("optics.f_numbers", "f-numbers")]
    pixel_pitches: Annotated[list[float], Setting("optics.pixel_pitches", "pixel pitches, um")]
    wavelength: Annotated[float, Setting("optics.wavelength", "wavelength, um")]
    fill_factor: Annotated[
        float, Setting("optics.fill_factor", "share of a pixel that collects light")
    ]
    defocus: Annotated[float, Setting("optics.defocus", "distance from the focus, um")]
    spherical: Annotated[
        float, Setting("optics.spherical", "spherical aberration at f/2, wavelengths")
    ]
    confusions: Annotated[
        list[float], Setting("optics.confusions", "circles of confusion that count as sharp, um")
    ]
    profile_f_number: Annotated[float, Setting("optics.profile_f_number", "f-number of profiles")]
    profile_pitch: Annotated[float, Setting("optics.profile_pitch", "pixel pitch of profiles, um")]


@dataclass(frozen=True)
class Blobs(Scales):
    """Gaussian blobs, and the ways in which they are detected (figure S4)."""

    size_from: Annotated[float, Setting("blobs.size_from", "smallest blob, pixels")]
    size_to: Annotated[float, Setting("blobs.size_to", "largest blob, pixels")]
    size_count: Annotated[int, Setting("blobs.size_count", "number of blobs")]
    kappas: Annotated[list[float], Setting("blobs.kappas", "ratios that are compared")]
    n_spo: Annotated[list[int], Setting("blobs.n_spo", "scales per octave")]
    camera_blur: Annotated[float, Setting("blobs.camera_blur", "blur of the camera, pixels")]
    assumed_blurs: Annotated[
        list[float], Setting("blobs.assumed_blurs", "blurs assumed instead, pixels")
    ]
