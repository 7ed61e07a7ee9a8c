"""Where jobs run and how results reach the disk: executors, output folders, whole-or-nothing files."""
