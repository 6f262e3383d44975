"""Background runs: a run in a process of its own, which goes on when the page or the server that started it ends.

    process   the process: runs the procedure, writes the status, waits for answers
    status    the order that the process is given, and its status file, which any process may read
    control   starts a background run, pauses, stops, answers; also for a run that was started in a terminal

Four files in the record's folder under `apart/`, named by a key: `KEY.json` is the status, `KEY.answers` a named pipe
for answers, `KEY.log` the process's standard error, `KEY.stop` the mark of a page that sends a signal. A lock
(`rig/lease.py`) shows whether the process is alive. SIGINT pauses, SIGTERM ends, as they do in a terminal: at once. A
signal without the mark is of another program: a signal number of its own would end the runs of an older program.
"""
