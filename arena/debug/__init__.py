"""A debugger on one robot of a trial: server, session, attachment and the controlled robot."""
