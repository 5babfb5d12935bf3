"""Lock-step execution: robots run ahead until they observe the world; scheduler, threads and processes."""
