"""The stages of the study, one module per rule of the workflow.

Each reads files, calls the library, and writes files; ``python -m keystab.stages.NAME --help``
says which. No scientific decision is made here. The blocks of settings that stages take stand in
`keystab.parameters`; this is what their other arguments mean. Help texts are taken from here.

What several stages take
    views : store of a set of views
    views_digest : checksums of the store of views
    n_spo : scales per octave of the samplings
    samplings : tables of extrema, one per sampling
    extrema : tables of discrete extrema
    traces : tables of refinement traces, in the order of the extrema
    keypoints : table of unique keypoints
    truth : table of true extrema
    store : stored scale-spaces
    store_digest : checksums of the stored scale-spaces
    table : table of results
    sigma_min : first scale, pixels of the view
    kappas : ratios of the two blurs
    n_resamples : bootstrap resamples
    name : name of the set of views, or of what the sets differ in
    names : names, in the order of the files
    values : value of each set

Views and scale-spaces
    kind : kind of scene that is made
    seed : which one of its kind
    exponent : how fast the power spectrum of a field falls
    angle : direction of edges and strokes, degrees
    picture : picture of the scene
    reference : picture that the simulated camera looks at
    reference_blur : blur that the picture has of itself, its pixels
    dtype : number type in the store
    pixels : table of pixels
    size : side of the square that is cut out, pixels
    delta_min : sampling steps, pixels
    oversampling : how the view is oversampled
    epsilon : least difference to the 26 neighbours, grey values

True extrema
    sigma_max : last scale, pixels
    truths : tables of true extrema, one per ratio of the two blurs
    sets : stores of the sets of views that are held against the scene
    sets_digest : checksums of these stores
    sweeps : sweep that each set is a member of
    guards : width of the guard band of each set, pixels
    features : table of features of keypoints
    causes : table of what stable and unstable keypoints are
    max_offsets : further values of M_offset
    most_iterations : largest finite N_interp

Comparison
    grid : tables of extrema, one per n_spo of the grid
    balanced_n_spo : scales per octave of the balanced samplings
    matches : table of which detection is which keypoint
    counts : table of counts
    occurrence : table of which keypoint is seen where
    summary : table of a few numbers
    per_group : number of stable keypoints, and of unstable ones
    panels : table of cubes
    cubes : table of their samples
    curve_n_spo : samplings whose curves are drawn
    iterations : further values of N_interp
    tilts : tilt of each view, where those of one tilt are matched by themselves
    unit : first scale of the octave in whose pixels others are compared too; 0 for none
    pairs : table of what becomes of the keypoints of the first view in the others
    interpolation : table of how stable the interpolation is
    dead : table of what is detected less than half a step above the first scale
    minimum_share : least share of the views that see a keypoint whose precision counts
    curves : table of curves of stability
    precision : table of precisions
    differences : table of what two choices of keypoints differ by
    edges : table of spreads along edges and across
    scales : table of counts against scale
    soft_ends : whether counterparts may lie beyond the ends of the range of scales
    border : pixels left out at the border of the view
    assumed_blur : camera blur that was assumed, pixels
    kappa : ratio of the two blurs
    tolerances : least difference in each variant, of grey values in [0, 1]; -1 where it was applied
    differences : what each variant differs in, in words
    scenes : name of the scene of each variant
    firsts : first of the samplings of each variant
    crossings : readings that each variant is crossed with, all, some, those that rates need, none
    crossed : table of rates in each reading
    variants : table of these words
    rates : table of rates of new and lost extrema

Scores
    thresholds : table of shares below thresholds
    roc : table of ROC curves
    auc : table of areas under ROC curves
    end : upper end of the scales held against the truth, over sigma-min
    detections : table of scored detections
    gain : table of what models gain

Error bars
    first_scale : lower end of the scales, over sigma-min
    coverage : table of the shares that ellipses hold
    strata : the same in parts of the keypoints
    reliability : table of what returns, against what was predicted
    separation : table of how well guesses tell what returns
    moved : store of views from different places
    moved_digest : checksums of the store of these views
    weights : table of the errors of motion and depth from weighted keypoints

Audits
    scene : pixels of the scene that detectors are shown
    detector : name of a detector, or control
    condition : name of a condition, _ for a blank
    durations : table of the seconds that detectors took
    audit : table of what was found of detectors
    octaves : the same by octave
    phases : table of errors against the sub-pixel phase
    audits : tables of what was found of each detector in each condition
    audits_by_octave : the same by octave
    audits_by_phase : tables of errors against the sub-pixel phase

Theory
    sift_sigma_min : first scale of SIFT as shipped, pixels
    sift_delta_min : sampling step of SIFT as shipped, pixels
    profiles : table of profiles of point spread functions
    camera_blur : camera blur, pixels
    ranges : table of the camera blurs between which cameras in focus lie
    aliasing : table of the aliased part of views
    wrong_blur : table of scale-spaces of a wrong blur, against dilated ones
    zoomed : table of true extrema of zoomed views, against each other
    noisy : table of what noise of the reference changes
    n_oct : octaves

Claims and results
    claims : file of claims
    tables : tables that claims need
    draft : whether the run is a draft
    settings : files of settings, for the reader
    verdicts : verdicts on each picture, CSV
    families : family of each scene
    over_scenes : table of what claims are over scenes
    by_family : table of on how many scenes of each family they hold
    numbers : table of the numbers of claims over scenes
    csv : table of verdicts
    json : the same as JSON
    markdown : the same as Markdown
    files : files that the study ends in
    checksums : list of their checksums
"""
