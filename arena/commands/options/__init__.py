"""Options that several commands of `arena` share: types of arguments, the plan of trials, trust in code, progress."""
