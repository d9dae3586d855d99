# SPDX-License-Identifier: BSD-3-Clause
"""A function in a child process: libraries in C++ that read files of others may crash, loop or ask for all memory, and none
of that is an answer to the person who gave the file."""
import os
import pickle
import resource
import signal

from read import Fault

TIME_S = 60
MEMORY = 3 << 30    # bytes of heap


def work(function, arguments, pipe):
    """In the child. What the library prints is lost; what it returns goes through the pipe."""
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(TIME_S)
    try:
        answer = (True, function(*arguments))
    except Exception as error:  # whatever it is, it goes back as text
        answer = (False, " ".join(str(error).split())[:160] or type(error).__name__)
    with os.fdopen(pipe, "wb") as out:
        pickle.dump(answer, out)


def call(what, function, *arguments):
    """function(*arguments), or a Fault that begins with `what` (a file) where it fails in whatever way."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(reader)
            work(function, arguments, writer)
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as answer:
        data = answer.read()
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM:
        raise Fault(f"{what}: no answer within {TIME_S} s; simplify the mesh where it comes from")
    if not data:
        raise Fault(f"{what}: the library that reads it ended without an answer; the file is damaged: export it again")
    good, value = pickle.loads(data)
    if not good:
        raise Fault(f"{what}: {value}; export it again, or as OBJ, STL or PLY")
    return value
