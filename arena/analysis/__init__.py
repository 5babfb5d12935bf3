"""From records to results: comparisons, statistics, plots and reports. Never touches a world."""
