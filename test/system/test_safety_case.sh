#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# doc/safety-case.md names for each hazard the test that shows what ends it: each of them exists and is run.
set -u
fails=0 count=0
for name in $(grep -oE '`(test_[a-z0-9_]+|laxer_[a-z_]+)`' doc/safety-case.md | tr -d '`' | sort -u); do
  count=$((count + 1))
  if grep -rqE "RUN\($name\)|def $name\(|verdict $name " test/unit test/system test/replay || ls test/*/"$name".* >/dev/null 2>&1; then continue; fi
  echo "  $name is no test"; fails=1
done
if [ "$count" -lt 20 ]; then echo "  only $count tests are named"; fails=1; fi
if [ "$fails" -eq 0 ]; then echo "ok every_test_of_the_safety_case_exists"; else echo "FAIL every_test_of_the_safety_case_exists"; fi
exit $fails
