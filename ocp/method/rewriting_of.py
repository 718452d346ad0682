"""What a problem is rewritten to before a method of its own gets it, if anything."""

from ocp.method.in_normal_form import InNormalForm
from ocp.method.in_sizes import InSizes
from ocp.normal_form.normal_form import normal_form
from ocp.problem.ocp import OCP
from ocp.problem.scaled import scaled


def rewriting_of(ocp: OCP) -> InNormalForm | InSizes | None:
    """Return the next step: the normal form, then sizes; None where there is nothing to do.

    For what takes a solution to start from: it works on ``written(solution)``, and gives back the
    ``answer``.
    """
    form = normal_form(ocp)
    if form is not None:
        return InNormalForm(form)
    in_sizes = scaled(ocp)
    return None if in_sizes is None else InSizes(in_sizes)
