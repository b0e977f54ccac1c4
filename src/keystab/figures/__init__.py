"""The figures: one module per figure, each drawing from the tables of the study and nothing else.

``python -m keystab.figures.fig5 --tables results/tables --pdf figures/fig5.pdf --png
figures/fig5.png`` draws one of them. Every module offers ``TABLES`` (the files it reads and the
columns it needs) and ``draw(tables, draft) -> Figure``; `keystab.figures.style` and
`keystab.figures.palette` hold what they share.
These are the only modules that import matplotlib and seaborn.
"""
