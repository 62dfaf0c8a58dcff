"""ros2 launch follow.launch.py robot:=robot.toml; `limo-hog` must be on the PATH."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration


def generate_launch_description():
    """Return what `ros2 launch` starts."""
    follow = ["limo-hog", "follow", "--ros2", "--robot", LaunchConfiguration("robot"), "--max-speed", "0.4"]
    names = ["--ros-args", "-r", "scan:=scan_filtered", "-r", "cmd_vel:=base/cmd_vel"]
    return LaunchDescription(
        [
            DeclareLaunchArgument("robot", default_value="robot.toml"),
            ExecuteProcess(cmd=[*follow, *names], output="screen", sigterm_timeout="5"),
        ]
    )
