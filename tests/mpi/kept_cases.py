"""What the solver keeps from one iteration to the next spares work and changes no result."""

import numpy as np
import pytest
from contact_bodies import after_steps, closing_sulcus

TIGHT = {"solver": {"newton_tolerance": 1e-9}}


def counted(monkeypatch, problem):
    """Return a list that grows by one with each elastic tangent that is assembled."""
    assemble, calls = problem._elastic.matrix.assemble, []

    def noted():
        calls.append(None)
        assemble()

    monkeypatch.setattr(problem._elastic.matrix, "assemble", noted)
    return calls


@pytest.mark.parametrize("kind", ["global", pytest.param("none", marks=pytest.mark.one_rank)])
def test_an_elastic_tangent_that_is_kept_spares_others_and_leads_to_the_same_place(kind, monkeypatch):
    folding, state = closing_sulcus(kind, **TIGHT)
    start = state.positions
    calls = counted(monkeypatch, folding.problem)
    kept, few = after_steps(folding, state, 6), calls

    folding, state = closing_sulcus(kind, **TIGHT)
    calls = counted(monkeypatch, folding.problem)
    monkeypatch.setattr(folding.problem._elastic, "predicts", lambda *_: False)
    anew = after_steps(folding, state, 6)
    assert len(few) < len(calls)
    moved = np.abs(anew.positions - start).max()
    assert np.abs(kept.positions - anew.positions).max() <= 1e-6 * moved


def test_a_tangent_that_predicts_other_forces_is_not_kept():
    folding, state = closing_sulcus("none")
    folding.begin(state, state.step_s)
    problem, residual = folding.problem, folding.problem.new_vector()
    x, _, z = folding.domain.local(state.positions).T
    # nothing moves at the base and at the sides, which are held
    u = 0.2 * np.stack([np.sin(np.pi * x / 6e-3) * z, 0 * z, 0 * z], axis=1)
    for part, known in ((0.0, False), (1e-4, True), (1.0, False)):
        problem.set_displacement(part * u)
        problem.residual(residual)
        assert problem._elastic.predicts(problem.vector, 0.03) == known
        problem.tangent(within=0.03)


@pytest.mark.parametrize("support", ["box", pytest.param("free", marks=pytest.mark.one_rank)])
def test_newtons_method_begins_at_the_first_good_guess(support):
    folding, state = closing_sulcus("global", support=support)
    state = after_steps(folding, state, 3)
    folding.begin(state, state.step_s)
    folding.solver.solve(folding.domain.local(state.last))
    found = folding.problem.displacement.copy()
    assert folding.solver.solve(found).newton == 0
    assert folding.solver.solve(-found, found, 0.5 * found).newton == 0
    assert np.abs(folding.problem.displacement - found).max() <= 1e-9 * np.abs(found).max()
    assert folding.solver.solve(0.5 * found).newton > 0
