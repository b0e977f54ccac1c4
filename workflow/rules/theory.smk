"""What theory says of cameras, blobs and noise, without any picture (sections 2.3, 3.2, 4 and 6.3).

Comes in: settings. Goes out: {results}/tables/figS3*.csv, figS4.csv and fig12_theory.csv. Steps:
the point spread functions of model cameras and the Gaussians nearest to them; Gaussian blobs of
many sizes, the scales at which they are detected, and those that closed forms predict; the noise
of the difference of Gaussians.
"""


rule camera_optics:
    """Figure S3: the Gaussian blur that stands for a lens and its pixels."""
    output:
        table=f"{RESULTS}/tables/figS3.csv",
        profiles=f"{RESULTS}/tables/figS3_profiles.csv",
    log:
        f"{LOGS}/camera_optics.log",
    benchmark:
        f"{LOGS}/benchmarks/camera_optics.tsv"
    params:
        f_numbers=setting("optics.f_numbers"),
        pixel_pitches=setting("optics.pixel_pitches"),
        wavelength=setting("optics.wavelength"),
        fill_factor=setting("optics.fill_factor"),
        defocus=setting("optics.defocus"),
        spherical=setting("optics.spherical"),
        profile_f_number=setting("optics.profile_f_number"),
        profile_pitch=setting("optics.profile_pitch"),
        code=fingerprint("keystab.stages.camera_optics"),
        software=SOFTWARE,
    message:
        "Fitting Gaussians to the blur of cameras with pixels of {params.pixel_pitches} um"
    shell:
        """
        python -m keystab.stages.camera_optics \
            --f-numbers {params.f_numbers} \
            --pixel-pitches {params.pixel_pitches} \
            --wavelength {params.wavelength} \
            --fill-factor {params.fill_factor} \
            --defocus {params.defocus} \
            --spherical {params.spherical} \
            --profile-f-number {params.profile_f_number} \
            --profile-pitch {params.profile_pitch} \
            --table {output.table:q} \
            --profiles {output.profiles:q} \
            >{log:q} 2>&1
        """


rule detect_blobs:
    """Figure S4: detect blobs of many sizes in all ways that are compared."""
    output:
        extrema=f"{RESULTS}/keypoints/blobs_extrema.parquet",
        traces=f"{RESULTS}/keypoints/blobs_traces.parquet",
    log:
        f"{LOGS}/detect_blobs.log",
    benchmark:
        f"{LOGS}/benchmarks/detect_blobs.tsv"
    params:
        size_from=setting("blobs.size_from"),
        size_to=setting("blobs.size_to"),
        size_count=setting("blobs.size_count"),
        kappas=setting("blobs.kappas"),
        n_spo=setting("blobs.n_spo"),
        camera_blur=setting("blobs.camera_blur"),
        assumed_blurs=setting("blobs.assumed_blurs"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        code=fingerprint("keystab.stages.detect_blobs"),
        software=SOFTWARE,
    message:
        "Detecting blobs of {params.size_from} to {params.size_to} px at n_spo = {params.n_spo}"
    shell:
        """
        python -m keystab.stages.detect_blobs \
            --size-from {params.size_from} \
            --size-to {params.size_to} \
            --size-count {params.size_count} \
            --kappas {params.kappas} \
            --n-spo {params.n_spo} \
            --camera-blur {params.camera_blur} \
            --assumed-blurs {params.assumed_blurs} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --extrema {output.extrema:q} \
            --traces {output.traces:q} \
            >{log:q} 2>&1
        """


rule match_blobs:
    """Figure S4: the scales at which blobs are detected, and those that theory says."""
    input:
        extrema=f"{RESULTS}/keypoints/blobs_extrema.parquet",
        traces=f"{RESULTS}/keypoints/blobs_traces.parquet",
    output:
        table=f"{RESULTS}/tables/figS4.csv",
    log:
        f"{LOGS}/match_blobs.log",
    benchmark:
        f"{LOGS}/benchmarks/match_blobs.tsv"
    params:
        size_from=setting("blobs.size_from"),
        size_to=setting("blobs.size_to"),
        size_count=setting("blobs.size_count"),
        kappas=setting("blobs.kappas"),
        n_spo=setting("blobs.n_spo"),
        camera_blur=setting("blobs.camera_blur"),
        assumed_blurs=setting("blobs.assumed_blurs"),
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        max_offset=setting("refinement.max_offset"),
        max_iterations=setting("refinement.max_iterations"),
        code=fingerprint("keystab.stages.match_blobs"),
        software=SOFTWARE,
    message:
        "Comparing the scales of blobs with theory"
    shell:
        """
        python -m keystab.stages.match_blobs \
            --size-from {params.size_from} \
            --size-to {params.size_to} \
            --size-count {params.size_count} \
            --kappas {params.kappas} \
            --n-spo {params.n_spo} \
            --camera-blur {params.camera_blur} \
            --assumed-blurs {params.assumed_blurs} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --extrema {input.extrema:q} \
            --traces {input.traces:q} \
            --max-offset {params.max_offset} \
            --max-iterations {params.max_iterations} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """


rule noise_theory:
    """Figure 12: noise of the difference of Gaussians against scale, in closed form."""
    output:
        table=f"{RESULTS}/tables/fig12_theory.csv",
    log:
        f"{LOGS}/noise_theory.log",
    benchmark:
        f"{LOGS}/benchmarks/noise_theory.tsv"
    params:
        camera_blur=blur_of_noisy_views,
        sigma_min=setting("detector.sigma_min"),
        kappa=setting("detector.kappa"),
        n_oct=setting(f"sets.{SWEEPS['noise'][0].name}.n_oct"),
        code=fingerprint("keystab.stages.noise_theory"),
        software=SOFTWARE,
    message:
        "Computing the noise of the difference of Gaussians"
    shell:
        """
        python -m keystab.stages.noise_theory \
            --camera-blur {params.camera_blur} \
            --sigma-min {params.sigma_min} \
            --kappa {params.kappa} \
            --n-oct {params.n_oct} \
            --table {output.table:q} \
            >{log:q} 2>&1
        """
