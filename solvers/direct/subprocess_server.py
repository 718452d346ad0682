"""The process of ``SubprocessFunction``: evaluates one CasADi Function, and may be ended in it.

Run as a file, so that it imports CasADi and nothing of this package; its argument is the file
descriptor of an open socket. In: the pair of Function and seconds, then for each call its number
and a dictionary of inputs. Out: 0 as soon as it is ready, then for each call that number, and
``(outputs, stats)`` or the exception; or None, and the name of the signal that ended the child that
evaluates.
"""

import os
import signal
import sys
from multiprocessing.connection import Connection

import casadi as ca
import numpy as np


def main() -> None:
    """Let a child evaluate; if a signal ends it, report that and start another one.

    A fork is ready at once; a new process would import CasADi and read the Function again.
    """
    # Ignored and blocked signals are inherited from the parent process.
    for number in (signal.SIGALRM, signal.SIGCHLD):
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGALRM})
    pipe = Connection(int(sys.argv[1]))
    function, seconds = pipe.recv()
    pipe.send((0, None))
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
    """Reply to calls until the pipe is closed.

    The alarm of the kernel ends the process wherever it is, in compiled code too.
    """
    while True:
        try:
            number, inputs = pipe.recv()
        except EOFError:
            return
        signal.setitimer(signal.ITIMER_REAL, seconds)
        try:
            outputs = {name: np.array(value).ravel() for name, value in function(**inputs).items()}
            reply = outputs, function.stats()
        except RuntimeError as error:
            reply = RuntimeError(str(error))
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        pipe.send((number, reply))


if __name__ == "__main__":
    main()
