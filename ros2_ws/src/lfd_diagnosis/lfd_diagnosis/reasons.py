"""Verdicts in words: what convicted a sensor, and what acquits the others."""

from collections.abc import Callable
from math import isfinite, isnan
from typing import Any

from lfd_diagnosis.evidence import Ground
from lfd_diagnosis.radar_state import READY_SCANS
from lfd_diagnosis.robust_diagnosis import VALID_CLEARANCE_STD, VALID_VELOCITY_STD
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import VERDICTS, Kind, State

UNSEEN = "the radar sees no lead"

KIND_WORDS = {int(kind): kind.name.lower() for kind in Kind}

_GROUND_WORDS: dict[int, Callable[[Any], str]] = {
    Ground.ROUGHNESS: lambda b: f"roughness: {b.first:.0%} of samples far rougher than before",
    Ground.REPETITION: lambda b: f"repetition: the same value {b.first:.0f} times",
    Ground.PATH: lambda b: (
        f"path: the clearance left that of the relative velocity by {b.first:.2f} m "
        f"(limit {b.second:.2f})"
    ),
    Ground.JUMPED_BACK: lambda b: (
        f"jump back: by {b.first:.2f} m (limit {b.second:.2f}) to where nothing is wrong; "
        "it was off until then"
    ),
    Ground.SPEED_HELD: lambda b: f"{b.first:.2f} m/s for {b.second:.0f} samples on end",
    Ground.SPEED_JUMPED: lambda b: (
        f"a jump of {b.first:.2f} m/s in {b.second * 1000:.0f} ms (limit {b.third:.2f})"
    ),
    Ground.SPEED_LEFT: lambda b: (
        f"its derivative left what the accelerometer feels by {b.first:.2f} m/s^2 "
        f"(limit {b.second:.2f}), which itself changed by {b.third:.2f}"
    ),
    Ground.LEAD_JUMPED: lambda b: (
        f"it jumped from {b.first:.2f} to {b.second:.2f} m/s^2 (limit {b.third:.2f})"
    ),
    Ground.LEAD_DISAGREES: lambda b: (
        f"it says {b.first:.2f} m/s^2, radar and host make it {b.second:.2f} (limit {b.third:.2f})"
    ),
}

_CHECK_NAMES = {
    Ground.HOST_SPEED: "host speed",
    Ground.LEADS_WORD: "lead's word",
    Ground.OBSERVERS: "observers",
}


def _check(name: str, residual: float, limit: float) -> str:
    return f"{name}: off by {residual:.2f} m/s^2 (limit {limit:.2f})"


def _words(because: Any) -> str:
    if because.ground in _CHECK_NAMES:
        return _check(_CHECK_NAMES[because.ground], because.first, because.second)
    return _GROUND_WORDS[because.ground](because)


def _residual(residual: float, limit: float, unit: str) -> str:
    return f"prediction residual: {residual:.2f} {unit} (limit {limit:.2f})"


def silent(age: float) -> str:
    """Why there is nothing to judge, for a sample of that age in s."""
    return "no sample yet" if isnan(age) else f"no sample for {age:.2f} s"


def radar_reason(worse_is_velocity: bool, reasons: dict[str, str]) -> str:
    """The radar's reason is that of the worse of its signals."""
    if worse_is_velocity:
        return f"relative velocity: {reasons['relative_velocity']}"
    return f"clearance: {reasons['clearance']}"


def robust_reasons(
    settings: DiagnosisSettings, said: Any, anew_because: str, sensor_text: str
) -> dict[str, str]:
    """The reason of each verdict by name, the radar's left out; `said`: an unpacked outcome.

    `anew_because` says why nothing from before some step counts, `sensor_text` what the radar
    says of itself.
    """
    evidence = said.evidence
    if evidence.silent:
        return {name: "nothing arrives at all" for name in VERDICTS if name != "radar"}
    filling = ""
    if State.NOT_READY in (
        said.clearance.state,
        said.relative_velocity.state,
        said.acceleration.state,
    ):
        filling = _filling(evidence, anew_because)
    host_speed = _host_speed(settings, said.host_speed, evidence)
    lead = filling
    if State.FAULT in (said.clearance.state, said.relative_velocity.state):
        lead = "the radar is faulty"
    elif not settings.use_observers:
        lead = "parameter use_observers"
    unheard = f"neither host speed ({host_speed}) nor lead ({lead})"
    says = f"; the radar says: {sensor_text}" if sensor_text else ""
    return {
        "clearance": _radar_signal(said.clearance, evidence.clearance, evidence, filling, "m")
        + says,
        "relative_velocity": _radar_signal(
            said.relative_velocity,
            evidence.relative_velocity,
            evidence,
            filling,
            "m/s",
        )
        + says,
        "acceleration": _acceleration(said.acceleration, evidence, unheard),
        "host_speed": host_speed,
        "lead_acceleration": _lead(settings, said.lead_acceleration, evidence),
    }


def _filling(evidence: Any, anew_because: str) -> str:
    if evidence.unseen:
        return UNSEEN
    if evidence.scans >= READY_SCANS:
        return "nothing new to judge in this scan"
    because = f" after: {anew_because}" if evidence.anew and anew_because else ""
    return f"{evidence.scans} of {READY_SCANS} scans of this target{because}"


def _radar_signal(verdict: Any, evidence: Any, radar: Any, filling: str, unit: str) -> str:
    """`evidence` of the one signal, `radar`: of both."""
    state = verdict.state
    if state == State.NO_DATA:
        return f"transport: {silent(evidence.age)}"
    if state == State.NO_TARGET:
        return UNSEEN
    if state == State.NOT_READY:
        return filling
    now = UNSEEN if radar.unseen else _residual(evidence.residual, evidence.limit, unit)
    if state != State.FAULT:
        return f"{now}; scan {evidence.age * 1000:.0f} ms old{_rejected(evidence.outliers)}"
    because = evidence.because
    if because.ground == Ground.RESIDUAL:
        words = _residual(because.first, because.second, unit)
    else:
        words = _words(because)
    reason = f"{KIND_WORDS[verdict.kind]} by {words}"
    if evidence.lost:
        long = f" for {evidence.must_agree:g} s" if evidence.must_agree else ""
        return f"{reason}; reference lost: a new target must agree{long}"
    if because.ground != Ground.JUMPED_BACK:
        # What is said of it is that it is over.
        reason += _by_now(words, now)
    if not evidence.tellable:
        return f"{reason}; can no longer be told from a healthy signal"
    if evidence.must_agree:
        return f"{reason}; did not jump back: it must agree for {evidence.must_agree:g} s"
    return reason


def _by_now(convicted: str, now: str) -> str:
    """What is so by now where that is not what convicted the signal; its evidence is named once."""
    if now == convicted:
        return ""
    name, _, rest = now.partition(": ")
    return f"; now {rest if convicted.startswith(f'{name}: ') else now}"


def _rejected(outliers: int) -> str:
    if not outliers:
        return ""
    return f"; {outliers} single outlier{'' if outliers == 1 else 's'} rejected so far"


def _acceleration(verdict: Any, evidence: Any, unheard: str) -> str:
    """`unheard`: why there is nothing to hold it against."""
    check, age = evidence.check, evidence.acceleration_age
    now = "nothing to hold it against yet"
    if check.ground and isfinite(check.residual):
        now = _check(_CHECK_NAMES[check.ground], check.residual, check.limit)
    if verdict.state == State.NO_DATA:
        reason = f"transport: {silent(age)}"
    elif verdict.state == State.FAULT:
        words = _words(evidence.because)
        reason = f"{KIND_WORDS[verdict.kind]} by {words}{_by_now(words, now)}"
    elif verdict.state == State.NOT_READY:
        reason = unheard
    else:
        reason = f"{now}; sample {age * 1000:.0f} ms old"
        reason += _rejected(evidence.acceleration_outliers)
        if evidence.may_reverse:
            reason += "; the car may reverse, by a speed without a sign"
    if evidence.speed_faulty:
        reason += f"; host speed is not used: {_words(evidence.speed_because)}"
    if evidence.lead_faulty:
        reason += f"; the lead's word is not used: {_words(evidence.lead_because)}"
    return reason


def _host_speed(settings: DiagnosisSettings, verdict: Any, evidence: Any) -> str:
    if not settings.use_host_speed:
        return "not used (parameter use_host_speed)"
    age = evidence.host_speed_age
    if verdict.state == State.NO_DATA:
        return f"transport: {silent(age)}"
    if verdict.state == State.FAULT:
        kind = KIND_WORDS[verdict.kind]
        return f"{kind} by {_words(evidence.speed_because)}; not used as evidence"
    if verdict.state == State.NOT_READY:
        if not isnan(evidence.speed_every):
            return f"a sample every {evidence.speed_every:.1f} s only: too late to be evidence"
        return "its derivative is settling"
    sample = f"sample {age * 1000:.0f} ms old{_rejected(evidence.speed_outliers)}"
    if verdict.state == State.SUSPECT:
        return f"jump of {evidence.speed_doubt:.2f} m/s, which may be an outlier; {sample}"
    return f"derivative {evidence.derivative:.2f} m/s^2; {sample}"


def _lead(settings: DiagnosisSettings, verdict: Any, evidence: Any) -> str:
    if not settings.use_lead_report:
        return "not used (parameter use_lead_report)"
    if verdict.state == State.NO_DATA:
        return f"transport: {silent(evidence.lead_age)}"
    if verdict.state == State.FAULT:
        return f"{_words(evidence.lead_because)}; not used as evidence"
    if verdict.state == State.NOT_READY:
        return "must agree with radar and host for a while first"
    off, limit = evidence.lead_off, evidence.lead_limit
    return f"off by {off:.2f} m/s^2 from radar and host (limit {limit:.2f})"


def robust_missing(_settings: DiagnosisSettings, said: Any, anew_because: str) -> str:
    """Why reconstructed signals are not offered; empty where all are."""
    made, evidence, missing = said.reconstructed, said.evidence, []
    if not evidence.has_track:
        missing.append(f"radar signals: {_filling(evidence, anew_because)}")
    else:
        if evidence.clearance_std > VALID_CLEARANCE_STD:
            missing.append(f"clearance: not known better than to {evidence.clearance_std:.1f} m")
        elif not made.clearance_valid:
            missing.append("clearance: expected to be below zero, where no lead is")
        if evidence.relative_velocity_std > VALID_VELOCITY_STD:
            std = evidence.relative_velocity_std
            missing.append(f"relative velocity: not known better than to {std:.1f} m/s")
    if not made.relative_acceleration_valid:
        missing.append("relative acceleration: no observer tells it, or a radar signal is faulty")
    if not made.acceleration_valid:
        missing.append("acceleration: neither host speed nor lead tells it")
    return "; ".join(missing)


def paper_reasons(
    settings: DiagnosisSettings, said: Any, anew_because: str, sensor_text: str
) -> dict[str, str]:
    """The same for the paper profile."""
    evidence = said.evidence
    not_judged = "not judged by the paper profile"
    reasons = {"host_speed": not_judged, "lead_acceleration": not_judged}
    if evidence.silent:
        return {name: reasons.get(name, "nothing arrives at all") for name in VERDICTS}
    n = settings.prediction_steps
    filling = _stored(evidence.stored, n, anew_because)
    says = f"; the radar says: {sensor_text}" if sensor_text else ""
    for name, unit in (("clearance", "m"), ("relative_velocity", "m/s")):
        verdict = getattr(said, name)
        if not isnan(verdict.index):
            count, value = getattr(evidence, f"{name}_count"), getattr(evidence, name)
            reason = f"{count} of {n} predictions disagree with {value:.2f} {unit}"
        elif verdict.state == State.NO_DATA:
            reason = silent(getattr(evidence, f"{name}_age"))
        elif verdict.state == State.NO_TARGET:
            reason = UNSEEN
        else:
            reason = filling
        reasons[name] = reason + says
    if not isnan(said.acceleration.index):
        reason = (
            f"{evidence.observers} of {evidence.observer_count} observers exclude "
            f"{evidence.acceleration:.2f} m/s^2 "
            f"(first one's limits {evidence.lower:.2f} to {evidence.upper:.2f})"
        )
    elif said.acceleration.state == State.NO_DATA:
        reason = silent(evidence.acceleration_age)
    else:
        reason = filling if evidence.answered else "the observer bank did not answer"
    reasons["acceleration"] = reason
    return reasons


def _stored(count: int, steps: int, anew_because: str) -> str:
    because = f" after: {anew_because}" if anew_because else ""
    return f"{count} of {steps} predictions stored{because}"


def paper_missing(settings: DiagnosisSettings, said: Any, anew_because: str) -> str:
    """Why reconstructed signals are not offered; empty where all are."""
    made, evidence, missing = said.reconstructed, said.evidence, []
    if not evidence.complete:
        filling = _stored(evidence.stored_now, settings.prediction_steps, anew_because)
        missing.append(f"radar signals: {filling}")
    if said.radar.state == State.FAULT:
        missing.append("acceleration: the radar is faulty")
    elif not made.relative_acceleration_valid:
        missing.append("acceleration: the observers are not ready")
    return "; ".join(missing)
