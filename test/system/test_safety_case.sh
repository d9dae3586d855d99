#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# doc/safety-case.md names for each hazard the test that shows what ends it: each of them exists and is run.
set -u
fails=0 count=0
# Shell and Python say a verdict's name in different ways: as a word of its own, in quotes or not.
for name in $(grep -oE '`[a-z0-9]+(_[a-z0-9${}]+){2,}`' doc/safety-case.md | tr -d '`' | grep -v '^gv_' | sort -u); do
  count=$((count + 1))
  if grep -rqF -e "RUN($name)" -e "def $name(" -e "verdict $name " -e "verdict(\"$name\"" -e "keeps $name " -e "\"$name\"" -e " $name\"" \
    test/unit test/system test/replay test/fuzz || ls test/*/"$name".* >/dev/null 2>&1; then continue; fi
  echo "  $name is no test"; fails=1
done
if [ "$count" -lt 60 ]; then echo "  only $count tests are named"; fails=1; fi
if [ "$fails" -eq 0 ]; then echo "ok every_test_of_the_safety_case_exists"; else echo "FAIL every_test_of_the_safety_case_exists"; fi
exit $fails
