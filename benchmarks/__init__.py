"""Time against error, beside other people's methods; `python -m benchmarks.rays` and so on, from the checkout."""
