"""Where robots' maps lie on each other, against where they should: each robot's path is laid on its true one, and what remains between two is
the error of their relative placement. A map that is bent a little moves it little."""
import math

from benches.team_bench.carmen import between, compose, inverse, wrap
from benches.team_bench.judging import mean


def fit(estimate, truth):
    """truth_from_estimate of two trajectories by stamps, least squares; and the middle of the true path. None without common scans."""
    some = [(pose, found) for stamp, pose in zip(estimate.stamps, estimate.poses) if (found := truth.at(stamp)) is not None]
    if not some:
        return None
    ex, ey = mean(pose[0] for pose, _ in some), mean(pose[1] for pose, _ in some)
    tx, ty = mean(found[0] for _, found in some), mean(found[1] for _, found in some)
    sine = cosine = 0.0
    for pose, found in some:
        ax, ay, bx, by = pose[0] - ex, pose[1] - ey, found[0] - tx, found[1] - ty
        # Headings speak where the path is short: as much as points half a metre away.
        turn = found[2] - pose[2]
        sine += ax * by - ay * bx + 0.25 * math.sin(turn)
        cosine += ax * bx + ay * by + 0.25 * math.cos(turn)
    yaw = math.atan2(sine, cosine)
    c, s = math.cos(yaw), math.sin(yaw)
    return (tx - c * ex + s * ey, ty - s * ex - c * ey, yaw), (tx, ty)


def off_by(truth_from_a, truth_from_b, at):
    """Metres and degrees between what two fits say of a true place; both fits are of one estimated frame."""
    difference = compose(truth_from_b, inverse(truth_from_a))
    moved = compose(difference, (*at, 0.0))
    return math.dist(moved[:2], at), abs(math.degrees(wrap(difference[2])))


def of_verdict(b_from_a, fit_a, fit_b):
    """How far a verdict's transform is off, at the middle of the first robot's path."""
    truth_from_b_frame, truth_from_a_frame, at = fit_b[0], fit_a[0], fit_a[1]
    return off_by(truth_from_a_frame, compose(truth_from_b_frame, b_from_a), at)


def belief(verdict, fits, right_m=0.3, right_deg=2.0):
    """[probability, whether the best alignment is right] of a verdict; None where there is no alignment. Maps without a common truth (fits of
    other places) are given as None: no alignment of them is right."""
    place = verdict["b_from_a"]
    if place is None or "x" not in place:
        return None
    fit_a, fit_b = fits.get(verdict["a"]), fits.get(verdict["b"])
    if fit_a is None or fit_b is None:
        return [verdict["probability"], False]
    metres, degrees = of_verdict((place["x"], place["y"], place["yaw"]), fit_a, fit_b)
    return [verdict["probability"], metres <= right_m and degrees <= right_deg]


def of_team(team, truths):
    """{(robot, robot): (m, deg), or None where they are apart}."""
    fits = {robot: fit(trajectory, truths[robot]) for robot, (_, trajectory) in team.items() if robot in truths}
    names, found = sorted(fits), {}
    for i, a in enumerate(names):
        for b in names[i + 1:]:
            together = team[a][0] == team[b][0] and fits[a] and fits[b]
            found[a, b] = off_by(fits[a][0], fits[b][0], fits[b][1]) if together else None
    return found


def off_where_shared(looks, a, b, truth, b_from_a=(0.0, 0.0, 0.0)):
    """Metres and degrees that most (four of five) of the `looks` [(stamp of a, stamp of b)] at the same place are within, of what the truth says
    of the one scan from the other. `a`, `b`: trajectories, each in its own frame. None where no scan is known."""
    metres, degrees = [], []
    for stamp_a, stamp_b in looks:
        poses = a.at(stamp_a), b.at(stamp_b), truth.at(stamp_a), truth.at(stamp_b)
        if None in poses:
            continue
        x, y, yaw = between(between(poses[2], poses[3]), between(compose(b_from_a, poses[0]), poses[1]))
        metres.append(math.hypot(x, y))
        degrees.append(abs(math.degrees(wrap(yaw))))
    most = (4 * len(metres)) // 5
    return (sorted(metres)[most], sorted(degrees)[most]) if metres else None


def is_right_where_shared(verdict, looks, own, truth, right_m, right_deg):
    """Whether a verdict's transform lays the scans that saw the same as the truth does; `own`: the robots' own trajectories by name, those of `looks`
    in their order."""
    place, (a, b) = verdict["b_from_a"], own
    b_from_a = (place["x"], place["y"], place["yaw"])
    off = off_where_shared(looks, own[a], own[b], truth, b_from_a if verdict["a"] == a else inverse(b_from_a))
    return off is not None and off[0] <= right_m and off[1] <= right_deg
