"""The process of ``Apart``: serves one CasADi Function, and may be ended inside it.

Run as a file, so that it imports CasADi and nothing of this package; its argument is the number
of an open socket. In: the pair of Function and seconds, then a dictionary of inputs for each call.
Out: ``(outputs, stats)``, None where the Function threw, or the name of the signal that ended it.
"""

import os
import signal
import sys
from multiprocessing.connection import Connection

import casadi as ca
import numpy as np


def main() -> None:
    """Let a child answer; where it does not survive a call, say so and put another in its place.

    A fork is ready at once, while a new process would import CasADi and read the Function again.
    """
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
        pipe.send(signal.Signals(os.WTERMSIG(end)).name)


def _serve(function: ca.Function, seconds: float, pipe: Connection) -> None:
    """Answer until nobody asks any more.

    The kernel keeps the time: the alarm ends the process wherever it is, in C++ too.
    """
    while True:
        try:
            inputs = pipe.recv()
        except EOFError:
            return
        signal.setitimer(signal.ITIMER_REAL, seconds)
        try:
            outputs = {name: np.array(value).ravel() for name, value in function(**inputs).items()}
            answer = outputs, function.stats()
        except RuntimeError:
            answer = None
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        pipe.send(answer)


if __name__ == "__main__":
    main()
