"""The figures of Yapo & Cutler (2009) and the gallery: one function for each, which returns a `page.Plate`.

A plate is a matplotlib Figure with a title and a caption. Nothing of matplotlib loads before one of these modules does.
"""
