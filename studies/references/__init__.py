"""Reference results of the components by other means.

``python -m studies.references.NAME`` writes them.

They share no code with the models; the files are in ``fmus/NAME/reference``.
"""
