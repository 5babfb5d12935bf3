"""Many trials: worker processes, a Dask cluster, and bundles that others can verify."""
