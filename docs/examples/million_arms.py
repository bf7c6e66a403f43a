"""Monte Carlo of tracking errors: many arms whose masses differ from those that their controller assumes."""

import sys

import cupy as cp
import numpy as np

from vsacli import Gains, inverse_dynamics, load_robot, load_trajectory

sys.path.append("arms")
import vsa_3r_gpu

ARMS, DT, STEPS, EVERY = 1_000_000, 1e-3, 2000, 100
robot = load_robot("robots/vsa_3r.yaml")
trajectory = load_trajectory("trajectories/rest_to_rest.yaml", robot)

# What all arms share: the reference, (steps, joints, 1), and the state at its start.
command = trajectory.at(DT * np.arange(STEPS)).variables()
reference = {name: values[..., None] for name, values in command.items() if name != "time"}
first = inverse_dynamics(robot, trajectory)
state = {"q": first.q[0], "dq": 0, "theta": first.theta[0], "dtheta": 0}
gains = Gains.from_poles([-20] * 4, [-20] * 2)

# What is their own: masses of the links, with a standard deviation of 5 %.
rng = np.random.default_rng(1)
nominal = vsa_3r_gpu.NOMINAL_PARAMETERS
masses = {name: value * rng.normal(1, 0.05, ARMS) for name, value in nominal.items()}

states, flags, _ = vsa_3r_gpu.rollout_law(state, reference, gains, DT, STEPS, every=EVERY, parameters=masses)

wanted = trajectory.at(DT * EVERY * np.arange(1, STEPS // EVERY + 1)).q
errors = cp.abs(states["q"] - cp.asarray(wanted)[..., None]).max(axis=0)[:, flags == 0]
for joint, of_joint in zip(robot.joint_names, errors, strict=True):
    half, most = (float(cp.percentile(of_joint, share)) for share in (50, 99))
    print(f"{joint}: largest error below {half:.4f} rad in half of the arms, {most:.4f} rad in 99 %")
print(f"arms with a flag: {float((flags != 0).mean()):.2%}")
