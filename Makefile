# The study and its tests. Every target first makes .venv from environment.lock where it is missing
# or stale; PYTHON=... says with which Python.

SHELL := /bin/bash
# nproc would say what OMP_NUM_THREADS holds.
CORES ?= $(shell env -u OMP_NUM_THREADS -u OMP_THREAD_LIMIT nproc 2>/dev/null || \
    getconf _NPROCESSORS_ONLN)
WITH ?=
ARCHIVE ?=
RECOMPUTE ?=

# What a person's own variables say to the shell, Python, pip and Snakemake is for other projects:
# with them another library, other packages or other settings would be taken, or every job would
# compile all modules again.
unexport CDPATH BASH_ENV ENV PYTHONPATH PYTHONHOME PYTHONSTARTUP PYTHONUSERBASE PYTHONPLATLIBDIR \
    PYTHONWARNINGS PYTHONOPTIMIZE PYTHONSAFEPATH PYTHONINSPECT PYTHONCASEOK PYTHONEXECUTABLE \
    PYTHONUTF8 PYTHONIOENCODING PYTHONDONTWRITEBYTECODE VIRTUAL_ENV
export PYTHONNOUSERSITE := 1
export PATH := $(CURDIR)/.venv/bin:$(PATH)

# One run of Snakemake at a time works in a folder; each has as many jobs as CORES says.
.NOTPARALLEL:

SNAKEMAKE = $(NO_CORES)python tools/study.py $(EXECUTOR)
# A profile says itself how many jobs or cores its cluster takes, unless CORES is typed as well.
EXECUTOR = $(if $(filter command,$(origin PROFILE)),--profile '$(PROFILE)' $(if \
    $(filter command,$(origin CORES)),--cores $(CORES)),--cores $(CORES))
NO_CORES = $(if $(filter 0,$(CORES)),$(error CORES is 0, and Snakemake would wait for ever: give \
    the number of jobs at a time, at least 1))
OVERLAY = $(if $(WITH),--configfile $(WITH))
QUICK = --configfile config/quick.yaml
AUDITED = figures/audit.pdf
NO_WITH = $(if $(WITH),$(error drafts are of the default picture; for one of yours give folders \
    of their own in $(WITH) and type: make study WITH="config/quick.yaml $(WITH)"))

.DEFAULT_GOAL := help
.PHONY: help study quick report audit scenes docs archive verify reference test test-slow mutants bench check check-workflow format lock why clean environment FORCE

help: ## List the targets
	@echo "make study                  the whole study"
	@echo "make figures/fig5.pdf       one figure (figures/quick/fig5.pdf: in draft form)"
	@echo "make study WITH=FILE        another answer: FILE of config/what_if, or your own settings"
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | grep -v '^study' | \
	    awk -F':.*## ' '{ printf "make %-22s %s\n", $$1, $$2 }'

study: environment ## The whole study
	$(SNAKEMAKE) $(OVERLAY)

quick: environment ## Every figure in draft form, in some minutes
	$(NO_WITH)$(SNAKEMAKE) $(QUICK)

figures/quick/% results/quick/%: environment FORCE
	$(NO_WITH)$(SNAKEMAKE) '$@' $(QUICK)

figures/% results/%: environment FORCE
	$(SNAKEMAKE) '$@' $(OVERLAY)

report: study ## One HTML file with figures, verdicts, costs and provenance, after the study
	python tools/report.py $(OVERLAY)

audit: environment .venv-audit/.stamp ## Hold detectors of others against what is there, outside of the study
	$(SNAKEMAKE) '$(AUDITED)' $(OVERLAY)

scenes: environment ## The claims on 33 scenes, which takes hours (SCENES="lake text_1": on some)
	$(NO_CORES)python tools/scenes.py $(foreach name,$(SCENES),'$(subst ','\'',$(name))') -- $(EXECUTOR) $(OVERLAY)

why: environment ## What would run, why, and for how long (TARGET=figures/fig5.pdf: for one file)
	@python tools/why.py $(if $(TARGET),'$(subst ','\'',$(TARGET))') $(OVERLAY)

docs: environment .venv-docs/.stamp ## The site with all documents: build/docs/index.html
	python tools/tutorial.py --check
	.venv-docs/bin/python -m sphinx --quiet --fail-on-warning --keep-going docs build/docs

test: environment ## The tests, in some minutes
	pytest -n 2 --dist loadfile --no-loadscope-reorder -m "not slow"

test-slow: environment ## The tests that take minutes: twenty kills of the draft, a cluster
	pytest -m slow

mutants: environment ## Which of 300 wrong lines do the tests notice, in hours; goes on where it stopped
	python tools/mutants.py run --all
	python tools/mutants.py table

archive: environment ## Pack the finished study into one file, results/archive/keystab-VERSION.zip
	keystab archive $(OVERLAY)

verify: environment ## Check the results here, or ARCHIVE=FILE (RECOMPUTE=fig5, or all: compute again)
	@keystab verify $(ARCHIVE) --cores $(CORES) $(OVERLAY) $(if $(RECOMPUTE),--recompute $(RECOMPUTE))

reference: environment ## Copy tables, claims and PNG figures to results/reference, to be committed
	keystab reference $(OVERLAY)

bench: environment .venv-audit/.stamp ## Compare speed and memory with other detectors
	python -m benchmarks

check: environment check-workflow ## Formatters, linters, types, the workflow
	ruff format --check
	ruff check
	mypy
	snakefmt --check Snakefile workflow
	codespell

check-workflow: environment
	python tools/lint_workflow.py
	snakemake --dry-run --quiet

format: environment ## Format all code and rules
	ruff check --fix
	ruff format
	snakefmt Snakefile workflow

LOCKED = --universal --fork-strategy fewest --generate-hashes --python-version 3.11 --no-header

lock: ## Renew environment.lock, audit.lock and docs.lock (needs uv)
	@command -v uv >/dev/null || { echo "error: make lock needs uv: pip install uv" >&2; exit 1; }
	uv pip compile $(LOCKED) --extra study --extra dev pyproject.toml -o environment.lock
	python tools/extra_requirements.py audit | uv pip compile $(LOCKED) - -o audit.lock
	python tools/extra_requirements.py docs | uv pip compile $(LOCKED) - -o docs.lock

clean: ## Delete all results, figures and logs
	rm -rf figures logs
	find results -mindepth 1 -maxdepth 1 ! -name reference ! -name README.md -exec rm -rf {} + 2>/dev/null || true

environment: ## Only .venv, with the command keystab, in a minute or two
	@tools/environment

.venv-audit/.stamp: audit.lock | environment
	@tools/audit_environment

.venv-docs/.stamp: docs.lock | environment
	@tools/docs_environment

FORCE:
