"""Terms that only the shipped tasks use; those of general use are in `otwarp.envs.terms`."""

from otwarp.envs.kernels import task_terms as functions
from otwarp.envs.terms import term

middle_offset = term(unit="µm", scale=20.0)(functions.middle_offset)
approach = term(unit="µm")(functions.approach)
crash = term()(functions.crash)
slip = term()(functions.slip)
parting = term()(functions.parting)
parted = term()(functions.parted)
raised = term(unit="µm", scale=4.0)(functions.raised)
wanted_rise = term(unit="µm", scale=4.0)(functions.wanted_rise)
rise_error = term(unit="µm")(functions.rise_error)
risen = term()(functions.risen)
risen_now = term()(functions.risen_now)
dropped = term()(functions.dropped)
carried_off = term(unit="µm")(functions.carried_off)
held_with_little = term()(functions.held_with_little)
thrift_now = term()(functions.thrift_now)
pressed = term()(functions.pressed)
