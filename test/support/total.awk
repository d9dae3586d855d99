# SPDX-License-Identifier: BSD-3-Clause
# The end of a run of test/run, from the TAP of its tests: figures, what failed with what it said, what was skipped and
# why, what ran twice, and the total. Exit code 1 where something failed or nothing ran.
function file_name() {
  name = FILENAME
  sub(/.*\//, "", name)
  sub(/\.[a-z]*$/, "", name)
  return name
}
FILENAME ~ /\.retried$/ { retried = retried " " $1; next }
FNR == 1 { comments = "" }
/^# *figure / {
  sub(/^# *figure /, "")
  if (figure_of != file_name()) printf "== %s\n", figure_of = file_name()
  print "     " $0
  next
}
/^ok.*# SKIP/ {
  skipped++
  why = $0
  sub(/.*# SKIP */, "", why)
  sub(/ *# SKIP.*/, "")
  sub(/^ok *[0-9]* *(- )?/, "")
  skips = skips "skip " file_name() ": " $0 ": " why "\n"
  comments = ""
  next
}
/^ok/ { passed++; comments = ""; next }
/^not ok/ {
  failed++
  sub(/^not ok *[0-9]* *(- )?/, "")
  # What was said since the last verdict belongs to it.
  fails = fails comments "FAIL " file_name() ": " $0 "\n"
  comments = ""
  next
}
/^#/ {
  sub(/^# ?/, "")
  comments = comments "  " $0 "\n"
}
END {
  printf "%s%s", skips, fails
  if (retried) printf "run twice, because the machine stood still:%s\n", retried
  printf "%d passed, %d failed", passed, failed
  if (skipped) printf ", %d skipped", skipped
  printf "\n"
  if (failed || proved != 0 || passed + skipped == 0) exit 1
}
