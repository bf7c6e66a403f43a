"""Chains of the robots in `example-robot-data` that are converted, and those that are refused."""

from __future__ import annotations

ARMS = (
    ("panda.urdf", "panda_link0", "panda_hand_tcp", "RRRRRRR"),
    ("panda_collision.urdf", "panda_link0", "panda_hand_tcp", "RRRRRRR"),
    ("ur3_robot.urdf", "world", "tool0", "RRRRRR"),
    ("ur3_joint_limited_robot.urdf", "world", "tool0", "RRRRRR"),
    ("ur3_gripper.urdf", "world", "tool0", "RRRRRR"),
    ("ur5_robot.urdf", "world", "tool0", "RRRRRR"),
    ("ur5_joint_limited_robot.urdf", "world", "tool0", "RRRRRR"),
    ("ur5_gripper.urdf", "world", "tool0", "RRRRRR"),
    ("ur10_robot.urdf", "world", "tool0", "RRRRRR"),
    ("ur10_joint_limited_robot.urdf", "world", "tool0", "RRRRRR"),
    ("kinova.urdf", "base", "j2s6s200_end_effector", "RRRRRR"),
    ("anymal-kinova.urdf", "base", "j2s6s200_end_effector", "RRRRRR"),
    ("xarm7.urdf", "world", "link_eef", "RRRRRRR"),
    ("z1.urdf", "world", "gripperMover", "RRRRRRR"),
    ("b1-z1.urdf", "base", "gripperMover", "RRRRRRR"),
    ("so100.urdf", "base", "jaw", "RRRRRR"),
    ("so101.urdf", "base_link", "moving_jaw_so101_v1_link", "RRRRRR"),
    ("baxter.urdf", "base", "left_gripper", "RRRRRRR"),
    ("baxter.urdf", "base", "right_gripper", "RRRRRRR"),
    ("pr2.urdf", "base_footprint", "l_gripper_tool_frame", "PRRRRRRR"),
    ("pr2.urdf", "torso_lift_link", "r_gripper_tool_frame", "RRRRRRR"),
    ("tiago.urdf", "base_footprint", "hand_tool_link", "PRRRRRRR"),
    ("tiago_no_hand.urdf", "torso_lift_link", "wrist_ft_tool_link", "RRRRRRR"),
    ("tiago_dual.urdf", "base_footprint", "hand_left_tool_link", "PRRRRRRR"),
    ("tiago_dual.urdf", "torso_lift_link", "hand_right_tool_link", "RRRRRRR"),
    ("tiago_pro.urdf", "base_footprint", "gripper_left_base_link", "PRRRRRRR"),
    ("tiago_pro.urdf", "torso_lift_link", "gripper_right_base_link", "RRRRRRR"),
    ("talos_left_arm.urdf", "arm_left_1_link", "gripper_left_motor_double_link", "RRRRRRR"),
    ("talos_full_v2.urdf", "base_link", "gripper_left_base_link", "RRRRRRRRR"),
    ("talos_full_v2_box.urdf", "torso_2_link", "gripper_right_base_link", "RRRRRRR"),
    ("talos_reduced.urdf", "torso_2_link", "gripper_left_base_link", "RRRRRRR"),
    ("talos_reduced_box.urdf", "torso_2_link", "gripper_left_base_link", "RRRRRRR"),
    ("talos_reduced_corrected.urdf", "torso_2_link", "gripper_right_base_link", "RRRRRRR"),
    ("centauro.urdf", "torso_2", "ball1_tip", "RRRRRR"),
    ("g1_29dof_rev_1_0.urdf", "torso_link", "left_rubber_hand", "RRRRRRR"),
    ("g1_29dof_with_hand_rev_1_0.urdf", "torso_link", "right_hand_palm_link", "RRRRRRR"),
    ("icub.urdf", "chest", "l_gripper", "RRRRRRR"),
    ("icub_reduced.urdf", "chest", "r_gripper", "RRRRRRR"),
    ("romeo.urdf", "torso", "l_wrist", "RRRRRRR"),
    ("romeo_small.urdf", "torso", "l_gripper", "RRRRRRR"),
    ("romeo_laas_small.urdf", "torso", "LArm_effector", "RRRRRRR"),
    ("alex_nub_hands.urdf", "Torso", "leftNub", "RRRRRRR"),
    ("alex_sake_hands.urdf", "Torso", "LeftSakePalmLink", "RRRRRRR"),
    ("alex_psyonic_hands.urdf", "Torso", "Left_thumb_base", "RRRRRRR"),
    ("human.urdf", "middle_thorax", "left_hand", "RRRRRRRR"),
    ("simple_humanoid.urdf", "torso", "l_wrist", "RRRRRRR"),
    ("simple_humanoid_classical.urdf", "torso", "r_wrist", "RRRRRRR"),
    ("hextilt_flying_arm_5.urdf", "hextilt__base_link", "flying_arm_5__gripper", "RRRRR"),
    ("borinot_flying_arm_2.urdf", "borinot__base_link", "flying_arm_2__ee", "RR"),
    ("double_pendulum.urdf", "base_link", "link2", "RR"),
    ("double_pendulum_simple.urdf", "base_link", "link3", "RR"),
    ("double_pendulum_continuous.urdf", "base_link", "link2", "RR"),
    ("TwoDofs.urdf", "world", "Tip", "RR"),
    ("finger_edu.urdf", "base_link", "finger_tip_link", "RRR"),
)
"""File, base, tip and types of joints: an arm, finger or pendulum of each file that has one."""

REFUSED = (
    ("alex_psyonic_hands.urdf", "so it has no drive of its own"),  # ring, pinky, middle, index fingers
    ("baxter.urdf", "so it has no drive of its own"),  # right fingers
    ("baxter.urdf", "outside the chain follows"),  # left fingers
    ("panda.urdf", "so it has no drive of its own"),  # right finger
    ("panda.urdf", "outside the chain follows"),  # left finger
    ("panda_collision.urdf", "so it has no drive of its own"),  # right finger
    ("panda_collision.urdf", "outside the chain follows"),  # left finger
    ("pr2.urdf", "so it has no drive of its own"),  # fingers
    ("romeo.urdf", "so it has no drive of its own"),  # fingers
    ("romeo_laas_small.urdf", "the tensor has the negative eigenvalue"),  # legs
    ("talos_full_v2.urdf", "so it has no drive of its own"),  # fingers
    ("talos_full_v2.urdf", "outside the chain follows"),  # fingers
    ("talos_full_v2_box.urdf", "so it has no drive of its own"),  # fingers
    ("talos_full_v2_box.urdf", "outside the chain follows"),  # fingers
    ("tiago_pro.urdf", "so it has no drive of its own"),  # fingers
    ("tiago_pro.urdf", "outside the chain follows"),  # fingers
    ("ur3.urdf", "the file describes no links"),  # all
    ("iris_simple.urdf", "no joint moves below"),  # all
    ("quadrotor_base.urdf", "no joint moves below"),  # all
)
"""Files of which chains are refused, and part of the message."""

WHOLE_REFUSED = (
    ("baxter.urdf", "so it has no drive of its own"),  # a finger of each gripper
    ("panda.urdf", "so it has no drive of its own"),  # right finger
    ("panda_collision.urdf", "so it has no drive of its own"),  # right finger
    ("pr2.urdf", "so it has no drive of its own"),  # fingers of both grippers
    ("romeo_laas_small.urdf", "the tensor has the negative eigenvalue"),  # legs
    ("talos_full_v2.urdf", "so it has no drive of its own"),  # fingers of both grippers
    ("talos_full_v2_box.urdf", "so it has no drive of its own"),  # fingers of both grippers
    ("tiago_pro.urdf", "so it has no drive of its own"),  # fingers of both grippers
    ("ur3.urdf", "the file describes no links"),
    ("iris_simple.urdf", "no joint moves below"),
    ("quadrotor_base.urdf", "no joint moves below"),
)
"""Files that are refused as a whole, and part of the message; without a drive, fingers can be held."""

WITHOUT_ARMS = (
    "a1.urdf",
    "alexander_v1.lowerBodyOnly.urdf",
    "allegro_left_hand.urdf",
    "allegro_right_hand.urdf",
    "anymal.urdf",
    "b1.urdf",
    "bolt.urdf",
    "go1.urdf",
    "go2.urdf",
    "hyq_no_sensors.urdf",
    "iris.urdf",
    "laikago.urdf",
    "quadruped.urdf",
    "solo.urdf",
    "solo12.urdf",
)
"""Files with nothing but legs, rotors or fingers."""
