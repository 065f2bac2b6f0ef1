# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Checks of recordings: what touched, and what the monitor would have said.

command    what the command replay_check does
arguments  what its command line means
parallel   many recordings at a time
check      one recording through the monitor
order      messages in the order in which a check takes them
live       what the monitor would have said, over time
plans      the plans of a recording, each checked when it comes
losses     what the recorder itself says was lost
motion     contacts by recorded motion
output     results for people, machines and other nodes
model      options, configuration, topics, results
bag        reading and writing recordings
kernels    compiled kernels, or plain Python if compiling would take longer
"""
