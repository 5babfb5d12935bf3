"""Analysis of recorded trials: comparisons, statistics, plots and reports."""
