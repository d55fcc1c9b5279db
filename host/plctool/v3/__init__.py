"""Components that were written for CODESYS Control V3: their interface files, and what they need here.

SPDX-License-Identifier: Apache-2.0
"""
