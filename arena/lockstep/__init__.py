"""Lock-step execution: robots run ahead until they observe the world; the scheduler in Python and in native code."""
