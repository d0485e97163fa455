"""Body, trajectories and followers: how a motion is executed and what is sent to the actuators."""
