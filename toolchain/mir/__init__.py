"""Machine form: dsPIC30F instructions over virtual and real registers, and liveness."""
