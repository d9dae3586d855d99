# gloved: the daemon for force-feedback gloves. `make help` lists the targets.
# Everything that is built lies under build/.

ifeq ($(origin CC),default)
CC      := gcc
endif
OPT     ?= -O2
B       ?= build/$(notdir $(firstword $(CC)))$(subst $(space),,$(OPT))
WARN    := -std=c11 -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wshadow -Wundef \
           -Wcast-align -Wmissing-prototypes -Wswitch-enum -Werror
# No fused multiply-add, no reordering: a replay gives the same bits with every compiler and level.
CFLAGS  += $(WARN) $(OPT) -g -ffp-contract=off -fno-fast-math -D_GNU_SOURCE -Iinclude -I$(B)/gen -MMD -MP
LDLIBS  := -lode -lccd -llcm -lconfig -lz -lpthread -lm
empty   :=
space   := $(empty) $(empty)

CORE    := $(wildcard src/*.c)
PROCESS := $(filter-out src/process/main.c,$(wildcard src/process/*.c))
DRIVERS := $(wildcard drivers/*.c)
TOOLS   := $(patsubst tools/%.c,%,$(wildcard tools/*.c))
TESTS   := $(patsubst test/%.c,%,$(wildcard test/test_*.c test/*_pipe.c))
TYPES   := $(patsubst data/lcm/%.lcm,%,$(wildcard data/lcm/*.lcm))
GEN_O   := $(TYPES:%=$(B)/gen/%.o)
OBJ      = $(1:%.c=$(B)/%.o)
LIB     := $(B)/libgloved.a

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SECONDARY:

## all: build the daemon, the tools and the tests
all: $(patsubst src/process/main.c,$(B)/gloved,$(wildcard src/process/main.c)) $(TOOLS:%=$(B)/%) $(TESTS:%=$(B)/test/%)

$(B)/%.o: %.c | $(B)/gen/.done
	@mkdir -p $(@D)
	$(CC) $(CFLAGS) -c $< -o $@
$(B)/gen/.done: $(wildcard data/lcm/*.lcm) | deps
	@mkdir -p $(B)/gen
	$(if $(TYPES),lcm-gen -c --c-cpath $(B)/gen --c-hpath $(B)/gen data/lcm/*.lcm)
	@touch $@
$(B)/gen/%.o: $(B)/gen/.done
	$(CC) -O2 -I$(B)/gen -c $(B)/gen/$*.c -o $@
$(LIB): $(call OBJ,$(CORE) $(PROCESS) $(DRIVERS)) $(GEN_O)
	@rm -f $@
	ar rcs $@ $^
$(B)/gloved: $(B)/src/process/main.o $(LIB)
	$(CC) $(LDFLAGS) $^ $(LDLIBS) -o $@
$(TOOLS:%=$(B)/%): $(B)/%: $(B)/tools/%.o $(LIB)
	$(CC) $(LDFLAGS) $^ $(LDLIBS) -o $@
$(TESTS:%=$(B)/test/%): $(B)/test/%: $(B)/test/%.o $(LIB)
	@mkdir -p $(@D)
	$(CC) $(LDFLAGS) $^ $(LDLIBS) -o $@

deps:

## test: build and run every test
test: all build/venv/.done
	@B=$(B) test/run
# What the tests in Python check against: the frame database and logs as other people's tools read them.
build/venv/.done:
	python3 -m venv build/venv
	build/venv/bin/pip install -q --disable-pip-version-check cantools python-can
	@touch $@

## help: this list
help:
	@sed -n 's/^## //p' $(MAKEFILE_LIST)

## clean: remove what was built
clean:
	rm -rf build

.PHONY: all deps test help clean
-include $(shell find $(B) -name '*.d' 2>/dev/null)
