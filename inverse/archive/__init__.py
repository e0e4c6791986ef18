"""Archives: many photographs of many eclipses fitted one by one and together, and what is kept of it.

`maker.make_archive` does the work, `command` is its command line. None of it is part of what a single fit depends on.
"""
