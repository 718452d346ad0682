"""The process of ``SubprocessFunction``: serves one CasADi Function, and may be ended inside it.

Run as a file, so that it imports CasADi and nothing of this package; its argument is the number
of an open socket. In: the pair of Function and seconds, then for each call its number and a
dictionary of inputs. Out: that number, and ``(outputs, stats)`` or the exception; or None, and the
name of the signal that ended whoever was to answer.
"""

import os
import signal
import sys
from multiprocessing.connection import Connection

import casadi as ca
import numpy as np


def main() -> None:
    """Let a child answer; where it does not survive, say so and put another in its place.

    A fork is ready at once, while a new process would import CasADi and read the Function again.
    """
    # What the process that started this one ignores or blocks is inherited.
    for number in (signal.SIGALRM, signal.SIGCHLD):
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGALRM})
    pipe = Connection(int(sys.argv[1]))
    function, seconds = pipe.recv()
    while True:
        child = os.fork()
        if not child:
            _serve(function, seconds, pipe)
            os._exit(0)
        _, end = os.waitpid(child, 0)
        if not os.WIFSIGNALED(end):
            return
        pipe.send((None, signal.Signals(os.WTERMSIG(end)).name))


def _serve(function: ca.Function, seconds: float, pipe: Connection) -> None:
    """Answer until nobody asks any more.

    The kernel keeps the time: the alarm ends the process wherever it is, in C++ too.
    """
    while True:
        try:
            number, inputs = pipe.recv()
        except EOFError:
            return
        signal.setitimer(signal.ITIMER_REAL, seconds)
        try:
            outputs = {name: np.array(value).ravel() for name, value in function(**inputs).items()}
            answer = outputs, function.stats()
        except RuntimeError as error:
            answer = RuntimeError(str(error))
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        pipe.send((number, answer))


if __name__ == "__main__":
    main()
