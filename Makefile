# gloved: the daemon for force-feedback gloves. `make help` lists the targets.
# Everything that is built lies under build/. V=1 shows the commands; CC=clang, OPT=-O0 build beside.

ifeq ($(origin CC),default)
CC      := gcc
endif
OPT     ?= -O2
# The one place of the version; the commit is added from git (a release's archive carries it in .commit).
VERSION := 0.1.0
COMMIT  := $(shell cat .commit 2>/dev/null || git describe --always --dirty=+ --exclude='*' 2>/dev/null || echo unknown)
empty   :=
space   := $(empty) $(empty)
B       ?= build/$(notdir $(firstword $(CC)))$(subst $(space),,$(OPT))
WARN    := -std=c11 -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wshadow -Wundef \
           -Wcast-align -Wmissing-prototypes -Wswitch-enum $(if $(CI),-Werror)
# Loops of three and six over vectors and blocks are written out: gcc does so only if told, clang by itself. The same bits, 4 to 7 % fewer
# instructions a step.
PEEL    := $(if $(findstring clang,$(CC)),,-fpeel-loops)
# No fused multiply-add, no reordering: a replay gives the same bits with every compiler and level.
override CFLAGS += $(CPPFLAGS) $(WARN) $(OPT) $(PEEL) -g -ffp-contract=off -fno-fast-math -fno-math-errno -D_GNU_SOURCE -Iinclude -Isrc -I. -Itest -I$(B)/gen -MMD -MP
# What sanitizers and coverage want at the end, too.
LDLIBS  := $(filter -fsanitize% --coverage,$(OPT)) -lode -lccd -llcm -lconfig -lz -lpthread -lm
Q       := $(if $(V),,@)

CORE    := $(wildcard $(addprefix src/,$(addsuffix /*.c,base hand collision dynamics safety wire engine)))
DAEMON  := $(filter-out src/daemon/main.c,$(wildcard src/daemon/*.c src/daemon/*/*.c))
DRIVERS := $(wildcard drivers/*.c)
TOOLS   := $(patsubst tools/%.c,%,$(wildcard tools/*.c))
TESTS   := $(basename $(notdir $(wildcard test/*/test_*.c test/support/*_pipe.c)))
TYPES   := $(patsubst data/lcm/%.lcm,%,$(wildcard data/lcm/*.lcm))
GEN_O   := $(TYPES:%=$(B)/gen/%.o)
OBJ      = $(1:%.c=$(B)/%.o)
LIB     := $(B)/libgloved.a

RUN_PACKAGES  := gcc libc6-dev libode-dev libccd-dev liblcm-dev liblcm-bin libconfig-dev zlib1g-dev
TEST_PACKAGES := $(RUN_PACKAGES) clang perl python3-venv can-utils glmark2-data valgrind pkg-config
RT_PACKAGES   := qemu-system-x86 busybox-static cpio python3
CAN_PACKAGES  := can-utils user-mode-linux kmod iproute2

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SECONDARY:

# What is shown: the Stanford bunny where it is compiled (make scenes; run: the box), else the box, or SCENE=FILE in a grasp
# that gloved-grasp finds for it, or SCRIPT=FILE.
OWN    := $(filter command,$(word 1,$(origin SCENE)))
GRASP  := build/grasps/$(subst /,_,$(basename $(SCENE))).user
SCRIPT := $(if $(OWN),$(GRASP),data/scripts/power_box.user)
SCENE  := $(or $(wildcard build/scenes/bunny.scene),data/scenes/box.scene)
## run: the demo: a simulated user grasps and lifts a box over UDP, in this terminal (SCENE=FILE: what is in there)
run: $(B)/gloved $(B)/fcusim $(if $(OWN),$(SCRIPT) $(SCENE))
	$(Q)B=$(B) tools/demo $(if $(OWN),$(SCRIPT) $(SCENE),$(if $(filter command,$(word 1,$(origin SCRIPT))),$(SCRIPT)))
$(GRASP): $(SCENE) $(B)/gloved-grasp
	@mkdir -p $(@D)
	$(Q)$(B)/gloved-grasp $(SCENE) -o $@

## look: a hand grasps a thing, in 3D in the browser (PORT=7000, SCENE=FILE; FCU=hand: sliders move the hand; LOG=FILE plays a log, LOG="A B" two side by side)
look: build/venv-look/.done $(if $(LOG),,$(B)/gloved $(SCENE) $(if $(OWN),$(SCRIPT)))
	$(Q)$(if $(LOG),build/venv-look/bin/python tools/look.py --port $(or $(PORT),7000) $(LOG),\
	  B=$(B) VIEWER="build/venv-look/bin/python tools/look.py" tools/view $(SCRIPT) $(SCENE))

## view: the same in Drake's viewer (420 MB at first use; PORT=7000, SCENE=FILE)
view: build/venv-view/.done $(B)/gloved $(SCENE) $(if $(OWN),$(SCRIPT))
	$(Q)B=$(B) tools/view $(SCRIPT) $(SCENE)

## hand: grasp it yourself, without a glove: keys in this terminal, the picture in the browser (HAND_SCENE=...)
HAND_SCENE := data/scenes/box.scene
hand: build/venv-look/.done $(B)/gloved $(B)/gloved-hand $(B)/gloved-command
	$(Q)B=$(B) VIEWER="build/venv-look/bin/python tools/look.py" tools/hand $(HAND_SCENE)
.PHONY: hand

## top: a running gloved on this terminal
top: $(B)/gloved-top
	$(Q)$(B)/gloved-top

## test-view: the page of gloved-look in a real browser (Chromium, without a display), and Drake's viewer; pictures checked
test-view: test-look build/venv-view/.done $(SCENE)
	$(Q)SCENE=$(SCENE) PYTHON=build/venv-view/bin/python B=$(B) test/run browser
## test-look: the page of gloved-look alone
test-look: build/.browser-packages build/venv-browser/.done $(B)/gloved
	$(Q)PYTHON=build/venv-browser/bin/python B=$(B) test/run page
.PHONY: test-look

## plot: pictures and tables of a run: make plot LOG=FILE (written by gloved --log), or COMPARE="FILE FILE"
plot: build/venv-plot/.done
	$(Q)$(if $(LOG)$(COMPARE),,echo 'plot: say which: make plot LOG=FILE, written by gloved --log FILE' >&2; exit 2)
	$(Q)build/venv-plot/bin/python tools/gloved_plot.py $(if $(COMPARE),--compare $(COMPARE),$(LOG))
build/venv-plot/.done: build/.run-packages
	$(Q)tools/packages python3-venv
	@echo "  VENV build/venv-plot"
	$(Q)python3 -m venv build/venv-plot
	$(Q)build/venv-plot/bin/pip install -q --disable-pip-version-check lcm numpy matplotlib mcap
	@touch $@
.PHONY: plot

## spy: lcm-spy with gloved's types (a window: needs a display)
spy: build/types.jar
	$(Q)tools/spy

## test-spy: lcm-spy on a display in memory, its window read by OCR
test-spy: build/.spy-test-packages build/types.jar $(B)/gloved
	$(Q)PYTHON=python3 B=$(B) test/run spy

# The types in Java, for lcm-spy.
build/types.jar: $(wildcard data/lcm/*.lcm) | build/.spy-packages
	@echo "  JAR  $@"
	$(Q)rm -rf build/types-java && mkdir -p build/types-java/classes
	$(Q)lcm-gen -j --jpath build/types-java data/lcm/*.lcm
	$(Q)javac -nowarn -cp /usr/share/java/lcm.jar -d build/types-java/classes build/types-java/gloved/*.java
	$(Q)jar cf $@ -C build/types-java/classes .
build/.spy-packages: build/.run-packages
	$(Q)tools/packages liblcm-java libjchart2d-java default-jdk
	@touch $@
build/.spy-test-packages: build/.spy-packages
	$(Q)tools/packages xvfb imagemagick tesseract-ocr python3
	@touch $@
.PHONY: spy test-spy

# Drake's viewer in the version that it was tried with, and what drives the browser in the test.
build/venv-view/.done: build/.look-packages
	@echo "  VENV build/venv-view (420 MB)"
	$(Q)python3 -m venv build/venv-view
	$(Q)build/venv-view/bin/pip install -q --disable-pip-version-check drake==1.51.1 lcm websocket-client pillow
	@touch $@
## pictures: those of README and doc/objects.md made anew: box, bunny, horse and cat in the hand, forces of a grasp (data/pictures)
PICTURED := build/scenes/bunny.scene build/scenes/horse.scene build/scenes/cat.scene
pictures: build/.browser-packages build/venv-browser/.done build/venv-plot/.done $(B)/gloved $(B)/gloved-grasp $(PICTURED)
	$(Q)$(B)/gloved-grasp build/scenes/horse.scene -o build/horse.user --seed $(HORSE_SEED)
	$(Q)$(B)/gloved-grasp build/scenes/cat.scene -o build/cat.user --seed $(CAT_SEED)
	$(Q)build/venv-browser/bin/python tools/pictures.py $(B) data/pictures box=data/scenes/box.scene,power_box \
	  bunny=build/scenes/bunny.scene,power_box horse=build/scenes/horse.scene,build/horse.user cat=build/scenes/cat.scene,build/cat.user \
	  bolt=data/scenes/bolt.scene,bolt_in_bore,time=7.2 handover=data/scenes/handover.scene,give_bar+take_bar,time=7.8
	$(Q)$(B)/gloved --fcu 'sim:data/scripts/power_box.user?speed=0' --lcm none --log build/power_box.lcm >/dev/null
	$(Q)build/venv-plot/bin/python tools/gloved_plot.py build/power_box.lcm --out build/power_box-plots >/dev/null
	$(Q)cp build/power_box-plots/power_box-force.png data/pictures/force.png
HORSE_SEED := 6
CAT_SEED   := 4
# What drives the browser in tests and for pictures.
build/venv-browser/.done: build/.look-packages
	@echo "  VENV build/venv-browser"
	$(Q)python3 -m venv build/venv-browser
	$(Q)build/venv-browser/bin/pip install -q --disable-pip-version-check lcm websocket-client pillow
	@touch $@
build/venv-look/.done: build/.look-packages
	@echo "  VENV build/venv-look"
	$(Q)python3 -m venv build/venv-look
	$(Q)build/venv-look/bin/pip install -q --disable-pip-version-check lcm
	@touch $@
build/.look-packages:
	$(Q)tools/packages $(RUN_PACKAGES) libjs-three python3-venv
	@mkdir -p build && touch $@ build/.run-packages
build/.browser-packages: build/.look-packages
	$(Q)tools/packages chromium
	@touch $@
.PHONY: top view look test-view pictures

## test: build and run every test (T="force wire": only those)
test: build/.test-packages build/venv/.ready build/venv-plot/.done
	$(Q)$(MAKE) --no-print-directory -j$$(nproc) all
	$(Q)B=$(B) test/run $(T)

## test-can: fcusim and gloved on real CAN interfaces, in a guest (no root, 90 s; also through cannelloni: Debian's, or CANNELLONI=PROGRAM)
test-can: build/.can-packages build/venv/.ready
	$(Q)$(MAKE) --no-print-directory all
	$(Q)B=$(B) test/can/run

## test-oracle: the contact solver beside Siconos, on the same problems (27 MB at first use, 30 s)
test-oracle: build/.oracle-packages
	$(Q)$(MAKE) --no-print-directory $(B)/test/oracle_siconos
	$(Q)$(B)/test/oracle_siconos
.PHONY: test-oracle
build/.oracle-packages: build/.test-packages
	$(Q)tools/packages libsiconos-numerics-dev
	@touch $@

## test-rt: a grasp on a PREEMPT_RT kernel in an emulated machine (no root needed; 70 MB at first use, about 90 s)
test-rt: build/.rt-packages
	$(Q)$(MAKE) --no-print-directory all
	$(Q)B=$(B) sh test/rt/run

## test-service: the packages under a systemd of their own: install, start, watchdog, restart, remove (root; about two minutes)
test-service: build/.service-packages deb
	$(Q)test/service/run
build/.service-packages: build/.run-packages
	$(Q)tools/packages debootstrap systemd-container
	@touch $@
.PHONY: test-service

## all: build the daemon, the tools and the tests
all: $(B)/gloved $(TOOLS:%=$(B)/%) $(TESTS:%=$(B)/test/%) $(B)/test/bench_engine $(B)/test/bench_latency $(B)/test/soak $(B)/test/campaign_alone $(B)/test/zwidth_point $(B)/test/report_grasp

# Meshes that become scenes (about 5 s each, the full bunny 20 s): things of our own, and Debian's bunny.
# gloved-scene and gloved-shapes make the virtual environment that they need. Masses in kilograms.
SHAPES := bottle bowl cone cup dice dumbbell hammer mug pawn ring screwdriver star_knob torus wrench
## scenes: the Stanford bunny (250 and 69,666 triangles), a horse, a cat and a dozen things to grasp, compiled into build/scenes
scenes: $(patsubst %,build/scenes/%.scene,bunny250 bunny horse cat $(SHAPES))

BUNNY  := /usr/share/glmark2/models/bunny.obj
COMPILER := $(filter-out tools/mesh/shapes.py,$(wildcard tools/mesh/*))
build/scenes/%.scene: KG = 0.2
build/scenes/hammer.scene: KG = 0.4
build/scenes/cup.scene build/scenes/ring.scene build/scenes/screwdriver.scene build/scenes/torus.scene: KG = 0.1
build/meshes/%.obj: tools/mesh/shapes.py
	$(Q)tools/gloved-shapes $(@D) $*
build/scenes/%.scene: build/meshes/%.obj $(COMPILER)
	@mkdir -p $(@D)
	@echo "  MESH $*"
	$(Q)tools/gloved-scene $< -o $@ --mass $(KG) --place-on-table
build/scenes/bunny250.scene: DETAIL = --simplify 250 --threshold 0.08
build/scenes/bunny.scene: DETAIL = --threshold 0.04 --max-pieces 96
build/scenes/bunny250.scene build/scenes/bunny.scene: $(COMPILER)
	@mkdir -p $(@D)
	$(Q)tools/packages glmark2-data
	@echo "  MESH $(basename $(@F))"
	$(Q)tools/gloved-scene $(BUNNY) -o $@ --up y --size 0.11 --mass $(KG) --place-on-table $(DETAIL)
# Animals of Debian's glmark2-data: edges where three faces meet, holes, eyes that are parts of their own.
build/scenes/horse.scene: LONG = 0.15
build/scenes/cat.scene: LONG = 0.12
build/scenes/horse.scene build/scenes/cat.scene: $(COMPILER)
	@mkdir -p $(@D)
	$(Q)tools/packages glmark2-data
	@echo "  MESH $(basename $(@F))"
	$(Q)tools/gloved-scene /usr/share/glmark2/models/$(basename $(@F)).3ds -o $@ --repair --up y --size $(LONG) --mass $(KG) --place-on-table
## test-scenes: compile every scene, then grasp, lift and hold each object in the simulated hand
test-scenes: scenes $(B)/test/test_grasp
	$(Q)B=$(B) test/run test_grasp
.PHONY: scenes test-scenes
.PRECIOUS: build/meshes/%.obj

## doc: the pages that are tables of what stands elsewhere (doc/configuration.md, wire.md, lcm.md), made anew
doc: build/venv/.ready $(B)/test/settings_pipe
	$(Q)build/venv/bin/python tools/doc_pages.py $(B)
## doc-pictures: those of the pages, from runs of the simulated user; prints the figures of doc/tuning.md
doc-pictures: build/venv-plot/.done $(B)/gloved
	$(Q)build/venv-plot/bin/python tools/doc_pictures.py $(B)
.PHONY: doc doc-pictures

## golden: write the traces' golden hashes anew (then say in the commit why they changed)
golden: $(B)/test/test_replay $(B)/test/test_assembly
	$(Q)$< --update && $(B)/test/test_assembly --update

## traces: record every trace anew through the wire, in real time, and their golden hashes
traces: $(B)/gloved $(B)/fcusim
	$(Q)for t in data/traces/*/; do B=$(B) tools/record-trace $$(basename $$t) || exit 1; done
	$(Q)$(MAKE) --no-print-directory golden

## bench-accuracy: a million poses of each of 39 pair types against exact oracles, both narrow phases (make test runs a tenth; 20 minutes)
bench-accuracy: $(B)/test/test_accuracy
	$(Q)$< --list | GV_POSES=$${GV_POSES:-1000000} xargs -n1 -P$$(nproc) $<
	$(Q)$< --list | GV_NARROW=libccd GV_POSES=$${GV_POSES:-1000000} xargs -n1 -P$$(nproc) $<

## bench: time of every step per scene, side by side with the peers, and how far all are from the laws of contact; writes data/bench/ (BENCH=NAME: one scene; 12 minutes)
bench: bench-peers
	$(Q)$(MAKE) --no-print-directory $(B)/test/bench_engine $(B)/test/bench_mujoco $(B)/test/bench_pairs
	$(Q)build/venv-bench/bin/python test/bench/bench.py $(B) $(BENCH)
	$(Q)$(MAKE) --no-print-directory residuals solvers

## latency: from a glove's frame to its force over UDP beside a bare echo, and the wake-up beside cyclictest (6 minutes)
latency: build/venv-plot/.done
	$(Q)tools/packages rt-tests
	$(Q)$(MAKE) --no-print-directory $(B)/gloved $(B)/test/bench_latency
	$(Q)build/venv-plot/bin/python test/bench/latency.py $(B) $(ROUNDS)

## instructions: what a step costs, for test_instructions to compare with, and the longest steps (then say in the commit why it changed)
instructions: $(B)/test/bench_engine $(B)/test/test_crowd
	$(Q)B=$(B) python3 test/replay/test_instructions.py --update && B=$(B) python3 test/replay/test_collision_bound.py --update && \
	  B=$(B) python3 test/replay/test_tail.py --update

## solvers: solvers, narrow phases and presets side by side on every recorded trace; writes data/bench/solvers.csv
solvers: $(B)/test/bench_engine $(B)/test/test_replay
	$(Q)B=$(B) python3 test/bench/solvers.py
.PHONY: solvers

## residuals: how far each solver, MuJoCo and Bullet are from the laws of contact; writes data/bench/residuals.csv (part of make bench)
residuals: bench-peers
	$(Q)$(MAKE) --no-print-directory $(B)/test/bench_engine $(B)/test/bench_laws $(B)/test/bench_mujoco
	$(Q)build/venv-bench/bin/python test/bench/residuals.py $(B) $(BENCH)
.PHONY: residuals

## bench-peers: install what the engine is measured against: MuJoCo, Bullet, coal
bench-peers: build/venv-bench/.done
build/venv-bench/.done: build/.test-packages
	$(Q)tools/packages g++ libeigen3-dev
	@echo "  VENV build/venv-bench"
	$(Q)python3 -m venv build/venv-bench
	$(Q)build/venv-bench/bin/pip install -q --disable-pip-version-check mujoco pybullet coal numpy matplotlib
	@touch $@

## format: lay the C out as .clang-format says (one statement a line, at most 110 columns)
format: build/venv-format/.done
	$(Q)git ls-files '*.c' '*.h' | xargs build/venv-format/bin/clang-format -i
build/venv-format/.done:
	$(Q)tools/packages python3-venv
	@echo "  VENV build/venv-format"
	$(Q)python3 -m venv build/venv-format
	$(Q)build/venv-format/bin/pip install -q --disable-pip-version-check clang-format==23.1.5
	@touch $@
.PHONY: format

## layers: check that no include or call crosses a wall (also part of the tests)
layers:
	$(Q)sh test/system/test_layers.sh

# Unit tests and replays with the compiler's own checks in every program, each in a build directory of its own.
# (Not test_accuracy and test_real, statistics over many poses and seeds; not test_strict, since sanitizers make system calls of their own.)
CHECKED  := $(filter-out test_accuracy test_real test_strict,$(basename $(notdir $(wildcard test/unit/test_*.c test/replay/test_*.c))))
ASAN     := -fsanitize=address,undefined -fno-sanitize-recover=all
tests: $(TESTS:%=$(B)/test/%)
## check-asan: unit tests and replays under the address and undefined-behaviour sanitizers (3 minutes)
check-asan: build/.test-packages build/.fuzz-packages build/venv/.ready
	$(Q)$(MAKE) --no-print-directory -j$$(nproc) CC=clang OPT='-O1 -fno-omit-frame-pointer $(ASAN)' B=build/asan tests
	$(Q)B=build/asan test/run $(CHECKED)
## cov: which lines of src and drivers all tests reach (build/cov/index.html; slower by half)
cov: build/.test-packages build/venv/.ready build/venv-plot/.done
	$(Q)build/venv/bin/python -m pip install -q --disable-pip-version-check gcovr
	$(Q)$(MAKE) --no-print-directory -j$$(nproc) OPT='-O1 --coverage' B=build/cov all
	$(Q)find build/cov -name '*.gcda' -delete
	$(Q)B=build/cov GV_POSES=1000 test/run $(T); \
	  build/venv/bin/python -m gcovr --root . --filter src/ --filter drivers/ --gcov-ignore-parse-errors=negative_hits.warn \
	    --html-details build/cov/index.html --txt build/cov/table --object-directory build/cov -j$$(nproc) build/cov && \
	  tail -n 5 build/cov/table && echo "every line: build/cov/index.html"

## soak: half an hour of random grasps, faults, requests and garbage in one process (SOAK_S=120: two minutes; SOAK_SEED=N: one round)
SOAK_S   ?= 1800
soak: build/.run-packages
	$(Q)$(MAKE) --no-print-directory $(B)/test/soak
	$(Q)SOAK_S=$(SOAK_S) $(B)/test/soak
$(B)/test/soak: $(B)/test/fuzz/soak.o $(B)/tools/fcusim/fault.o $(LIB)
	@mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) $^ $(LDLIBS) -o $@

# Random grasps from seeds: FIRST, then N of each family (test/campaign/draw.h). On a cluster: PROFILE=, as Snakemake means it.
N        ?= 100
FIRST    ?= 1
FAMILIES ?= boxes any
CHUNK    ?= 5
JOBS     ?= $(shell nproc)
# MuJoCo plays where it is installed (make bench-peers).
CAMPAIGN_BESIDE := $(if $(wildcard build/venv-bench/.done),mujoco,alone)
## campaign: N=100 random grasps of each family under all solvers, laws judged in every step (FIRST=1 FAMILIES="boxes any" PROFILE=); page in build/campaign
campaign: build/venv-campaign/.done build/venv-plot/.done
	$(Q)$(MAKE) --no-print-directory $(B)/test/campaign_$(CAMPAIGN_BESIDE)
	@mkdir -p build/campaign
	$(Q)build/venv-campaign/bin/snakemake --snakefile test/campaign/Snakefile --directory build/campaign --quiet rules host progress --nolock \
	  $(if $(PROFILE),--profile $(PROFILE),--cores $(JOBS)) --config root=$(CURDIR) worker=$(abspath $(B))/test/campaign_$(CAMPAIGN_BESIDE) \
	  python=$(CURDIR)/build/venv-plot/bin/python grasps=$(N) first=$(FIRST) chunk=$(CHUNK) families="$(FAMILIES)" \
	  solvers="dantzig quickstep mujoco" call='make campaign FAMILIES="$(FAMILIES)" N=$(N) FIRST=$(FIRST)'
.PHONY: campaign
build/venv-campaign/.done: build/.run-packages
	$(Q)tools/packages python3-venv
	@echo "  VENV build/venv-campaign (140 MB)"
	$(Q)python3 -m venv build/venv-campaign
	$(Q)build/venv-campaign/bin/pip install -q --disable-pip-version-check snakemake
	@touch $@

## quiet: how quiet the force is with stiff couplings, with and without the observer of the fingers (5 minutes); data/bench/quiet.csv
quiet: $(B)/test/test_real
	@mkdir -p build/quiet
	$(Q)for grasp in power_box pinch_box tripod_box regrasp_box bar_frame; do echo $$grasp; done | \
	  xargs -P $(JOBS) -I @ sh -c '$(B)/test/test_real table @ | grep , > build/quiet/@.csv'
	$(Q){ echo grasp,glove,user,k_f_n_m,rate_hz,observer,held,seeds,slip_mm,force_std_n,force_error_rms_n; \
	  cat build/quiet/*.csv; } > data/bench/quiet.csv
.PHONY: quiet

## zwidth: how stiff the coupling may be before the loop with a finger is noisy or oscillates: map over damping, delay, rate, quantum (5 minutes; POINTS=2: coarse; MORE=config=FILE: with other settings); data/bench/zwidth.csv, data/pictures/zwidth-*.png
POINTS ?= 4
zwidth: build/venv-campaign/.done build/venv-plot/.done
	$(Q)$(MAKE) --no-print-directory $(B)/test/zwidth_point
	@mkdir -p build/zwidth
	$(Q)build/venv-campaign/bin/snakemake --snakefile test/zwidth/Snakefile --directory build/zwidth --quiet rules host progress --nolock \
	  --forceall $(if $(PROFILE),--profile $(PROFILE),--cores $(JOBS)) --config root=$(CURDIR) worker=$(abspath $(B))/test/zwidth_point \
	  python=$(CURDIR)/build/venv-plot/bin/python per_decade=$(POINTS) more="$(MORE)"
	$(Q)$(if $(MORE),,cp build/zwidth/zwidth.csv data/bench/ && cp build/zwidth/zwidth-*.png data/pictures/)
.PHONY: zwidth

# What it reads of data/bench is of `make bench` on a quiet machine; everything else runs here, in virtual time.
SEEDS    ?= 16
## report: the paper's tests with every preset and both devices, stiffer couplings, beside the paper, MuJoCo, Bullet; makes doc/report.md (SEEDS=16; times are of the last make bench)
report: build/venv-campaign/.done build/venv-plot/.done build/scenes/bunny250.scene build/scenes/bunny.scene
	$(Q)$(MAKE) --no-print-directory $(B)/test/report_grasp
	@mkdir -p build/report
	$(Q)build/venv-campaign/bin/snakemake --snakefile test/report/Snakefile --directory build/report --quiet rules host --nolock --rerun-incomplete \
	  $(if $(PROFILE),--profile $(PROFILE),--cores $(JOBS)) --config root=$(CURDIR) worker=$(abspath $(B))/test/report_grasp seeds=$(SEEDS)
	$(Q)build/venv-plot/bin/python test/report/report.py build/report
	$(Q)build/venv-plot/bin/python test/report/plots.py
.PHONY: report

# Everything with Clang's fuzzer and sanitizers in it, in a build directory of its own.
FUZZ     := $(basename $(notdir $(wildcard test/fuzz/fuzz_*.c)))
FUZZ_S   ?= 600
FUZZ_OPT := -O1 -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all
## fuzz: random bytes for all that reads what others wrote, ten minutes in all (FUZZ_S=60: one; clang)
fuzz: build/.fuzz-packages
	$(Q)$(MAKE) --no-print-directory -j$$(nproc) CC=clang OPT='$(FUZZ_OPT)' B=build/fuzz $(FUZZ:%=build/fuzz/test/%)
	$(Q)test/fuzz/run $(FUZZ_S) $(FUZZ:%=build/fuzz/test/%)
## fuzz-corpus: keep in test/fuzz/corpus what `make fuzz` found and what it began with, the least that reaches as far
fuzz-corpus: build/venv/.ready
	$(Q)build/venv/bin/python test/fuzz/seeds.py build/fuzz/seeds
	$(Q)test/fuzz/keep $(FUZZ:%=build/fuzz/test/%)
$(FUZZ:%=$(B)/test/%): $(B)/test/%: $(B)/test/fuzz/%.o $(LIB)
	@mkdir -p $(@D)
	@echo "  LD   $@"
	$(Q)$(CC) -fsanitize=fuzzer $(LDFLAGS) $^ $(LDLIBS) -o $@
$(B)/test/fuzz_command: LDFLAGS += -Wl,--wrap=lcm_create,--wrap=lcm_subscribe,--wrap=lcm_publish,--wrap=lcm_handle_timeout,--wrap=lcm_eventlog_create,--wrap=lcm_subscription_set_queue_capacity

# What the build and the tests need, from Debian by name.
build/.run-packages:
	$(Q)tools/packages $(RUN_PACKAGES)
	@mkdir -p build && touch $@
build/.test-packages: build/.run-packages
	$(Q)tools/packages $(TEST_PACKAGES)
	@touch $@
build/.can-packages: build/.test-packages
	$(Q)tools/packages $(CAN_PACKAGES)
	$(Q)if apt-cache show cannelloni >/dev/null 2>&1; then tools/packages cannelloni; fi
	@touch $@
build/.rt-packages: build/.test-packages
	$(Q)tools/packages $(RT_PACKAGES)
	@touch $@
build/.fuzz-packages: build/.run-packages
	$(Q)tools/packages clang libclang-rt-dev
	@touch $@
# What the tests in Python check against: the frame database and logs as other people's tools read them.
build/venv/.ready: build/.test-packages
	@echo "  VENV build/venv"
	$(Q)python3 -m venv build/venv
	$(Q)build/venv/bin/python -m pip install -q --disable-pip-version-check pytest cantools python-can lcm cffi setuptools quickjs
	@touch $@

$(B)/%.o: %.c | $(B)/gen/.done
	@mkdir -p $(@D)
	@echo "  CC   $<"
	$(Q)$(CC) $(CFLAGS) -c $< -o $@
$(B)/gen/.done: $(wildcard data/lcm/*.lcm) | build/.run-packages
	@mkdir -p $(B)/gen
	$(Q)$(if $(TYPES),lcm-gen -c --c-cpath $(B)/gen --c-hpath $(B)/gen data/lcm/*.lcm)
	@touch $@
# Written only when it changes, so that a new commit builds anew what says it, and nothing else.
$(B)/gen/version.h: FORCE
	@mkdir -p $(@D)
	@printf '#define GLOVED_VERSION "%s"\n#define GLOVED_COMMIT "%s"\n' '$(VERSION)' '$(COMMIT)' > $@.new
	@if cmp -s $@.new $@; then rm $@.new; else mv $@.new $@; fi
.PHONY: FORCE
$(B)/src/base/version.o: $(B)/gen/version.h
$(B)/gen/%.o: $(B)/gen/.done
	$(Q)$(CC) -O2 -I$(B)/gen -c $(B)/gen/$*.c -o $@
$(LIB): $(call OBJ,$(CORE) $(DAEMON) $(DRIVERS)) $(GEN_O)
	@rm -f $@
	$(Q)ar rcs $@ $^
$(B)/gloved: $(B)/src/daemon/main.o $(LIB)
	@echo "  LD   $@"
	$(Q)$(CC) $(LDFLAGS) $^ $(LDLIBS) -o $@
$(TOOLS:%=$(B)/%): $(B)/%: $(B)/tools/%.o $(LIB)
	@echo "  LD   $@"
	$(Q)$(CC) $(LDFLAGS) $(filter-out $(LIB),$^) $(LIB) $(LDLIBS) -o $@
$(B)/fcusim: $(call OBJ,$(wildcard tools/fcusim/*.c))
$(B)/gloved-trace: $(call OBJ,$(wildcard tools/trace/*.c))
$(B)/gloved-grasp: $(call OBJ,$(wildcard tools/grasp/*.c))
# Benchmarks: clocks around the step's parts, by way of the linker; the peers from their own packages.
$(B)/test/bench_engine: $(B)/test/bench/bench_engine.o $(LIB)
	@mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) -Wl,--wrap=gv_engine_collide,--wrap=gv_dynamics_step $^ $(LDLIBS) -o $@
$(B)/test/bench_laws: $(B)/test/bench/bench_laws.o $(LIB)
	@mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) -Wl,--wrap=gv_choice_solve $^ $(LDLIBS) -o $@
$(B)/test/bench_latency: $(B)/test/bench/bench_latency.o $(LIB)
	@mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) $^ $(LDLIBS) -o $@
# An oracle with headers of its own.
$(B)/test/oracle/siconos.o: override CFLAGS += -isystem /usr/include/siconos -isystem /usr/include/siconos/numerics
$(B)/test/oracle_siconos: $(B)/test/oracle/siconos.o $(LIB)
	@mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) -Wl,--wrap=gv_choice_solve $^ -lsiconos_numerics $(LDLIBS) -o $@
# The campaign's worker, by itself and beside MuJoCo.
CAMPAIGN := $(addprefix $(B)/test/campaign/,campaign.o draw.o)
$(B)/test/campaign_alone: $(CAMPAIGN) $(B)/test/campaign/peer_none.o $(LIB)
	@mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) -Wl,--wrap=gv_choice_solve $^ $(LDLIBS) -o $@
$(B)/test/campaign_mujoco: $(CAMPAIGN) test/campaign/peer_mujoco.c $(LIB) build/venv-bench/.done
	@mkdir -p $(@D)
	$(Q)$(CC) -std=c11 -O2 -D_GNU_SOURCE -Iinclude -Isrc -Itest -isystem $(MUJOCO)/include $(CAMPAIGN) test/campaign/peer_mujoco.c $(LIB) \
	  $(wildcard $(MUJOCO)/libmujoco.so.*) -Wl,-rpath,$(abspath $(MUJOCO)) -Wl,--wrap=gv_choice_solve $(LDLIBS) -o $@
MUJOCO   = $(firstword $(wildcard build/venv-bench/lib/python3*/site-packages/mujoco))
$(B)/test/bench_mujoco: test/bench/bench_mujoco.c $(LIB) build/venv-bench/.done
	@mkdir -p $(@D)
	$(Q)$(CC) -std=c11 -O2 -D_GNU_SOURCE -Iinclude -Isrc -Itest -isystem $(MUJOCO)/include $< $(LIB) $(wildcard $(MUJOCO)/libmujoco.so.*) \
	  -Wl,-rpath,$(abspath $(MUJOCO)) -lm -o $@
CMEEL    = $(firstword $(wildcard build/venv-bench/lib/python3*/site-packages/cmeel.prefix))
$(B)/test/bench_pairs: $(B)/test/bench/bench_pairs.o test/bench/bench_coal.cc test/bench/bench_coal.h $(LIB) build/venv-bench/.done
	@mkdir -p $(@D)
	$(Q)g++ -std=c++17 -O2 -isystem $(CMEEL)/include -isystem /usr/include/eigen3 \
	  -Itest test/bench/bench_coal.cc $< $(LIB) $(CMEEL)/lib/libcoal.so -Wl,-rpath,$(abspath $(CMEEL))/lib -lccd -lm -o $@
# What make zwidth runs for each panel of its map.
$(B)/test/zwidth_point: $(B)/test/zwidth/zwidth.o $(LIB)
	@mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) $^ $(LDLIBS) -o $@

$(B)/test/report_grasp: $(B)/test/report/report_grasp.o $(LIB)
# Test programs lie side by side in $(B)/test, whatever folder their source is in.
define test_program
$(B)/test/$(basename $(notdir $1)): $(B)/$(1:.c=.o) $(LIB)
endef
$(foreach source,$(wildcard test/*/test_*.c test/support/*_pipe.c),$(eval $(call test_program,$(source))))
# The solvers' answers pass through the test.
$(B)/test/test_coulomb $(B)/test/test_grasp: LDFLAGS += -Wl,--wrap=gv_choice_solve
$(TESTS:%=$(B)/test/%) $(B)/test/report_grasp:
	@mkdir -p $(@D)
	$(Q)$(CC) $(LDFLAGS) $^ $(LDLIBS) -o $@

# ---- installed ------------------------------------------------------------------------------------------
PREFIX  ?= /usr/local
# Below PREFIX; a distribution may have a folder for each architecture.
LIBDIR  ?= lib
PROGRAMS := gloved $(TOOLS)
SCRIPTS  := gloved-plot gloved-scene gloved-shapes log-to-trace gloved-look
MANUALS  := $(PROGRAMS) $(SCRIPTS)
# Where no git repository answers (an archive), or one that has these files in no commit of its own (an archive in a clone): all files.
DATA     := $(addprefix data/,scenes scripts lcm calibration examples viewer gloved.conf gloved.dbc)
data_files = $$(git ls-files $(DATA) 2>/dev/null | grep . || find $(DATA) -type f)
# Engine, codecs and loaders alone: what other programs link. Only names with gv_ leave it.
PUBLIC   := $(CORE) $(filter-out src/daemon/load/scene_thread.c,$(wildcard src/daemon/load/scene_*.c)) \
            $(addprefix src/daemon/load/,conf.c config_load.c settings_table.c)
SONAME   := libgloved.so.0
$(B)/lib/%.o: %.c | $(B)/gen/.done
	@mkdir -p $(@D)
	$(Q)$(CC) $(CFLAGS) -fPIC -c $< -o $@
$(B)/lib/src/base/version.o: $(B)/gen/version.h
$(B)/lib/libgloved.a: $(PUBLIC:%.c=$(B)/lib/%.o)
	@echo "  LIB  $@"
	$(Q)$(LD) -r $^ -o $(B)/lib/gloved.o
	$(Q)objcopy --wildcard --keep-global-symbol='gv_*' $(B)/lib/gloved.o
	$(Q)rm -f $@ && ar rcs $@ $(B)/lib/gloved.o
$(B)/lib/$(SONAME): $(PUBLIC:%.c=$(B)/lib/%.o)
	@echo "  LIB  $@"
	$(Q)echo '{ global: gv_*; local: *; };' > $(B)/lib/exported
	$(Q)$(CC) $(LDFLAGS) -shared -Wl,-soname,$(SONAME) -Wl,--version-script=$(B)/lib/exported -Wl,-z,defs $^ -lode -lccd -lconfig -lm -o $@
## library: the engine for other programs: libgloved.a and .so under build/ (make install puts them in place)
library: $(B)/lib/libgloved.a $(B)/lib/$(SONAME)

# Manual pages from the programs' own --help.
what     = "$$(sed -n 's/^$1  *//p' data/install/names)"
$(PROGRAMS:%=$(B)/man/%.1): $(B)/man/%.1: $(B)/% tools/manual-page data/install/names
	@mkdir -p $(@D)
	$(Q)$(B)/$* --help | tools/manual-page $* $(VERSION) $(call what,$*) > $@
$(SCRIPTS:%=$(B)/man/%.1): $(B)/man/%.1: tools/% tools/manual-page data/install/names
	@mkdir -p $(@D)
	$(Q)tools/$* --help | tools/manual-page $* $(VERSION) $(call what,$*) > $@
man: $(MANUALS:%=$(B)/man/%.1)

SHARE := share/gloved
put = install -D -m $1 $2 "$(DESTDIR)$(PREFIX)/$3"
list-data:
	$(Q)for f in $(data_files); do echo $$f; done
.PHONY: list-data
## install: programs, library, data, manual pages, service (PREFIX=/usr/local, DESTDIR=)
install: $(PROGRAMS:%=$(B)/%) library man
	$(Q)for p in $(PROGRAMS); do $(call put,755,$(B)/$$p,bin/$$p); done
	$(Q)for m in $(MANUALS); do $(call put,644,$(B)/man/$$m.1,share/man/man1/$$m.1); done
	$(Q)for h in include/gloved/*.h; do $(call put,644,$$h,$$h); done
	$(Q)$(call put,644,$(B)/lib/libgloved.a,$(LIBDIR)/libgloved.a)
	$(Q)$(call put,644,$(B)/lib/$(SONAME),$(LIBDIR)/$(SONAME))
	$(Q)ln -sf $(SONAME) "$(DESTDIR)$(PREFIX)/$(LIBDIR)/libgloved.so"
	$(Q)for f in $(data_files); do $(call put,644,$$f,$(SHARE)/$${f#data/}); done
	$(Q)for f in tools/with-python tools/packages tools/mesh/python; do $(call put,755,$$f,lib/gloved/$$f); done
	$(Q)for f in tools/*.py tools/mesh/*.py; do $(call put,644,$$f,lib/gloved/$$f); done
	$(Q)for f in tools/version; do $(call put,755,$$f,lib/gloved/$$f); done; echo '$(VERSION) ($(COMMIT))' > $(B)/version; $(call put,644,$(B)/version,lib/gloved/version)
	$(Q)for s in $(SCRIPTS); do $(call put,755,tools/$$s,lib/gloved/tools/$$s); ln -sf ../lib/gloved/tools/$$s "$(DESTDIR)$(PREFIX)/bin/$$s"; done
	$(Q)ln -sfn ../../$(SHARE) "$(DESTDIR)$(PREFIX)/lib/gloved/data"
	$(Q)sed 's,@PREFIX@,$(PREFIX),;s,@LIBDIR@,$(LIBDIR),;s,@VERSION@,$(VERSION),' data/install/gloved.pc > $(B)/gloved.pc
	$(Q)$(call put,644,$(B)/gloved.pc,$(LIBDIR)/pkgconfig/gloved.pc)
	$(Q)sed 's,@PREFIX@,$(PREFIX),' data/install/gloved.service > $(B)/gloved.service
	$(Q)$(call put,644,$(B)/gloved.service,lib/systemd/system/gloved.service)
	$(Q)$(call put,644,data/install/gloved.rules,lib/udev/rules.d/70-gloved.rules)
	$(Q)$(call put,644,data/install/gloved.sysusers,lib/sysusers.d/gloved.conf)
	$(Q)$(call put,644,data/install/gloved.completion,share/bash-completion/completions/gloved)
	$(Q)for p in $(filter-out gloved,$(MANUALS)); do ln -sf gloved "$(DESTDIR)$(PREFIX)/share/bash-completion/completions/$$p"; done

## uninstall: removes what install put there (the same PREFIX and DESTDIR)
uninstall:
	$(Q)cd "$(DESTDIR)$(PREFIX)" && rm -rf $(PROGRAMS:%=bin/%) $(SCRIPTS:%=bin/%) $(MANUALS:%=share/man/man1/%.1) include/gloved $(LIBDIR)/libgloved.a \
	  $(LIBDIR)/$(SONAME) $(LIBDIR)/libgloved.so lib/gloved $(SHARE) $(LIBDIR)/pkgconfig/gloved.pc lib/systemd/system/gloved.service \
	  lib/udev/rules.d/70-gloved.rules lib/sysusers.d/gloved.conf $(MANUALS:%=share/bash-completion/completions/%)

## dist: an archive of this version, with its commit in it: build/gloved-VERSION.tar.gz
dist:
	@mkdir -p build
	$(Q)git describe --always --exclude='*' > build/.commit
	$(Q)git archive --prefix=gloved-$(VERSION)/ --add-file=build/.commit -o build/gloved-$(VERSION).tar.gz HEAD
	@echo build/gloved-$(VERSION).tar.gz

## deb: packages for this Debian: gloved, libgloved0, libgloved-dev, under build/deb, looked at by lintian
deb: build/.deb-packages dist
	$(Q)rm -rf build/deb && mkdir -p build/deb
	$(Q)tar -C build/deb -xzf build/gloved-$(VERSION).tar.gz
	$(Q)cp -r build/deb/gloved-$(VERSION)/data/install/debian build/deb/gloved-$(VERSION)/debian
	$(Q)sed -i "s/@VERSION@/$(VERSION)/;s/@DATE@/$$(git log -1 --format=%cD)/" build/deb/gloved-$(VERSION)/debian/changelog
	$(Q)cd build/deb/gloved-$(VERSION) && dpkg-buildpackage -us -uc -b -j$$(nproc) > ../log 2>&1 || { tail -n 20 ../log; exit 1; }
	$(Q)cd build/deb && lintian --allow-root --fail-on error,warning gloved_$(VERSION)*.changes && ls *.deb
build/.deb-packages: build/.run-packages
	$(Q)tools/packages build-essential debhelper dpkg-dev fakeroot lintian pkg-config
	@touch $@
.PHONY: library man install uninstall dist deb

## clean: remove what was built
clean:
	rm -rf build

## help: this list
help:
	@sed -n 's/^## //p' $(MAKEFILE_LIST)

.PHONY: run test test-can test-rt all bench latency bench-peers instructions bench-accuracy golden traces layers tests check-asan cov soak fuzz fuzz-corpus clean help
-include $(shell find $(B) -name '*.d' 2>/dev/null)
