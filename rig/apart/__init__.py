"""A run in a process of its own, which whoever started it need not outlive: it goes on when a page or a server ends.

    order     what is to be run, for the process's command line
    status    how it stands: one small file that the process writes anew at every step, and anyone may read
    process   the process: runs the procedure, writes the status, waits for answers
    steering  starts one, pauses, stops, answers, and tells how it stands
    teller    writes the status of a run as its watch hears it
    beside    the same of a run that was begun in a terminal, which is watched there: it can be looked at, and stopped

Three files in the record's folder under `apart/`, named by a key: `KEY.json` is the status, `KEY.answers` a named pipe
for answers, `KEY.log` what went to standard error. A lock (`rig/lease.py`) tells whether the process is alive. SIGINT
pauses, SIGTERM ends, as they do a run in a terminal: at once.
"""
