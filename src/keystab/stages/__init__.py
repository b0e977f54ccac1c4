"""The stages of the study, one module per rule of the workflow.

Each reads files, calls the library, and writes files; ``python -m keystab.stages.NAME --help``
says which. No scientific decision is made here.
"""
