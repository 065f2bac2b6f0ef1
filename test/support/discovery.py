# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""DDS that stays on this machine, with fast discovery."""

import os
from pathlib import Path

_PROFILE = """<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><profiles>
  <participant profile_name="prompt" is_default_profile="true"><rtps><builtin><discovery_config>
    {lease}<initialAnnouncements>
      <count>20</count><period><sec>0</sec><nanosec>20000000</nanosec></period>
    </initialAnnouncements>
  </discovery_config></builtin></rtps></participant>
</profiles></dds>
"""


_LEASE = '<leaseAnnouncement><sec>0</sec><nanosec>100000000</nanosec></leaseAnnouncement>'


def discover_promptly(folder: str, announces: bool = True) -> None:
    """
    Set the environment, which ROS reads on import and child processes inherit.

    ROS writes its files to the folder. With `announces`, participants announce themselves ten
    times a second and are found even if the first announcements are lost; that takes processor
    time, so benchmarks do without.
    """
    profile = Path(folder, 'prompt_discovery.xml')
    profile.write_text(_PROFILE.format(lease=_LEASE if announces else ''))
    os.environ.update(
        FASTRTPS_DEFAULT_PROFILES_FILE=str(profile), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST',
        ROS_LOG_DIR=folder)
