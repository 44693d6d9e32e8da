/* All of Stroll. A program that embeds a walk links libstroll; strl_build_* is in libstroll_build
 * (stroll/build.h). */
#ifndef STROLL_STROLL_H
#define STROLL_STROLL_H

#include "stroll/build.h"
#include "stroll/container.h"
#include "stroll/error.h"
#include "stroll/export.h"
#include "stroll/frame.h"
#include "stroll/render.h"
#include "stroll/source.h"
#include "stroll/version.h"
#include "stroll/walk.h"

#endif
