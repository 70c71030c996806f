"""The command line: one verb a function, no logic; what verbs do stands in `elys.verbs`, imported only when called."""
